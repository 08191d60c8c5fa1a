"""A writer of recordings that does not hold up the tick.

A write to an SD card can stall for seconds, and formatting a cycle takes longer than handing it over, so a
thread does both while the tick waits for the next cycle. Every line reaches the operating system at once and
the disk within a second: a killed process or a pulled battery costs the last moment, not the run.
"""

from __future__ import annotations

import gzip
import os
import shutil
import time
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread

from raccoon.core.files import naming_path, replacing
from raccoon.core.readings import Device
from raccoon.trace.encode import Cycle, cycle_line, device_line, json_line

WAITING_LIMIT = 20_000
"""Most cycles that may wait for a stalled disk (100 s at 200 Hz); beyond that the recording ends."""
_BATCH = 256
_SYNC_SECONDS = 1.0


class TraceWriter:
    """Writes a header line and cycles to `plain` and packs the file into `packed` at the end.

    failure: why the recording ended early, None if it did not. A recording that fails never disturbs the run.
    Raises FileExistsError if `plain` exists and `overwrite` is not set, OSError if the header cannot be
    written; then no file is left.
    """

    def __init__(self, plain: Path, packed: Path, header: str, *, overwrite: bool = False) -> None:
        self.failure: str | None = None
        # The program may change its current directory.
        self._plain, self._packed = plain.absolute(), packed.absolute()
        # Exclusive: another program may have taken the name since the caller checked.
        self._file = plain.open("wb" if overwrite else "xb", buffering=0)
        try:
            with naming_path(plain):
                _write_all(self._file.fileno(), header.encode())
        except BaseException:
            self._file.close()
            plain.unlink(missing_ok=True)
            raise
        self._queue: SimpleQueue[Cycle | None] = SimpleQueue()
        self._device: Device | None = None
        self._ticks = 0
        self._thread = Thread(target=self._work, name="trace writer", daemon=True)
        self._thread.start()

    def put(self, cycle: Cycle) -> None:
        """Hand over a cycle; returns at once."""
        if self.failure is None:
            if self._queue.qsize() >= WAITING_LIMIT:
                self.failure = f"the disk did not keep up: {WAITING_LIMIT} cycles were waiting"
            self._queue.put(cycle)

    def finish(self) -> None:
        """Write the waiting cycles, pack the file and remove the plain one. Call once."""
        self._queue.put(None)
        self._thread.join()
        try:
            with self._file:
                last = json_line({"end": self._ticks, "failure": self.failure})
                _write_all(self._file.fileno(), last.encode())
            pack(self._plain, self._packed)
            self._plain.unlink()
        except OSError as error:
            self.failure = self.failure or str(error)

    def _work(self) -> None:
        synced = time.monotonic()
        while batch := self._batch():
            try:
                self._write(batch)
                if time.monotonic() - synced > _SYNC_SECONDS:
                    os.fsync(self._file.fileno())
                    synced = time.monotonic()
            except Exception as error:  # of any kind: otherwise the recording would end without a message
                self.failure = str(error)
                return

    def _batch(self) -> list[Cycle]:
        """The waiting cycles, at most `_BATCH`; empty at the end."""
        batch: list[Cycle] = []
        item = self._queue.get()
        while item is not None:
            batch.append(item)
            if len(batch) == _BATCH:
                return batch
            try:
                item = self._queue.get_nowait()
            except Empty:
                return batch
        if batch:
            self._queue.put(None)
        return batch

    def _write(self, batch: list[Cycle]) -> None:
        lines: list[str] = []
        ticks = 0
        try:
            for cycle in batch:
                lines += self._lines(cycle)
                ticks += cycle.inputs is not None
        finally:
            _write_all(self._file.fileno(), "".join(lines).encode())
            self._ticks += ticks

    def _lines(self, cycle: Cycle) -> list[str]:
        line = cycle_line(cycle)
        if cycle.inputs is None or cycle.inputs.device is self._device:
            return [line]
        self._device = cycle.inputs.device
        return [device_line(self._device), line]


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def pack(plain: Path, packed: Path) -> None:
    """Gzip a file. The result appears completely or not at all; equal content gives equal bytes."""
    # Level 3 is within a few per cent of the default in less than half of the time.
    with (
        plain.open("rb") as source,
        replacing(packed) as raw,
        gzip.GzipFile(filename="", fileobj=raw, mode="wb", compresslevel=3, mtime=0) as target,
    ):
        shutil.copyfileobj(source, target, 1 << 18)
