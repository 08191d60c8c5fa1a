"""The rows of a CSV file of any origin: a bad line costs only that line."""

from __future__ import annotations

import csv
from collections import deque
from collections.abc import Iterator
from typing import IO

from raccoon.core.errors import TraceError

MAX_LINE = 1 << 20


class CsvRows:
    """An iterator, to be used once, over the values of each row; instead of a bad row, a text that says why
    it is bad.

    line: number of the last line read. is_cut_off: whether that line has no end, so that the file may be cut
    off in it. A quotation mark that is never closed, or closed within a value, spoils only its own line: the
    lines that it swallowed are read again without it.
    """

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
                rows = self._begin()  # the old reader may have reached the end
                yield f"{error}: is a quotation mark out of place?"
            else:
                yield cells

    def _begin(self) -> Iterator[list[str]]:
        return csv.reader(self._lines(), strict=True, delimiter=self._separator)

    def _give_back(self) -> None:
        """Push back all lines of the row except the first, to be read again."""
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
