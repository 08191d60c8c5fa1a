"""The rows of a CSV that others wrote: what is wrong with a line costs that line alone."""

from __future__ import annotations

import csv
from collections import deque
from collections.abc import Iterator
from typing import IO

from raccoon.core.errors import TraceError

MAX_LINE = 1 << 20


class CsvRows:
    """Iterate once: the values of each row, or as text why there are none.

    line: number of the line that was read last. is_cut_off: whether it has no end, so that the file may be
    cut off in it. A quotation mark that is never closed, or closed within a value, spoils its line alone:
    those that it took along are read once more without it."""

    def __init__(self, file: IO[str], separator: str) -> None:
        self.line = 0
        self.is_cut_off = False
        self._file, self._separator = file, separator
        self._taken: list[str] = []  # the lines of the row that is being read
        self._pushed_back: deque[str] = deque()

    def __iter__(self) -> Iterator[list[str] | str]:
        rows = self._begin()
        while True:
            self._taken.clear()
            try:
                cells = next(rows)
            except StopIteration:
                return
            except csv.Error as error:
                self._give_back()
                rows = self._begin()  # the old one may have met the end
                yield f"{error}: is a quotation mark out of place?"
            else:
                yield cells

    def _begin(self) -> Iterator[list[str]]:
        return csv.reader(self._lines(), strict=True, delimiter=self._separator)

    def _give_back(self) -> None:
        """All lines of the row but its first are to be read once more."""
        others = self._taken[1:]
        self._pushed_back.extendleft(reversed(others))
        self.line -= len(others)

    def _lines(self) -> Iterator[str]:
        while line := self._pushed_back.popleft() if self._pushed_back else self._file.readline(MAX_LINE):
            if len(line) == MAX_LINE:
                raise TraceError(f"a line is longer than {MAX_LINE} characters")
            self.is_cut_off = not line.endswith(("\n", "\r"))
            self.line += 1
            self._taken.append(line)
            yield line
