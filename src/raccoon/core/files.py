"""Files that appear whole or not at all."""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

MAX_LINKS = 40
"""Links that lead from one to the next before they count as a ring, as the system has it."""


def program_folder() -> Path | None:
    """The folder of the program that runs, None where it is none of a file."""
    program = getattr(sys.modules.get("__main__"), "__file__", None)
    return None if program is None else Path(program).absolute().parent


def near_program(name: str | Path) -> Path:
    """A file where the program was started, else beside the program where it is there alone: an editor or a
    service starts a program from wherever it likes. A file that is nowhere stays where it was started."""
    path, folder = Path(name), program_folder()
    if path.exists() or folder is None:
        return path
    beside = folder / path  # of an absolute path that path itself
    return beside if beside.exists() else path


_copies: ContextVar[Path | None] = ContextVar("_copies", default=None)
"""The folder of what programs keep just now; None: where they say."""


@contextmanager
def copy_kept_files() -> Iterator[None]:
    """Inside, what a program keeps from run to run (`kept_file`) is a copy, which is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="raccoon-") as folder:
        before = _copies.set(Path(folder))
        try:
            yield
        finally:
            _copies.reset(before)


def kept_file(name: str | Path) -> Path:
    """A file that a program keeps from run to run, found as `near_program` finds one."""
    path, folder = near_program(name), _copies.get()
    if folder is None:
        return path
    copy = folder / hashlib.sha256(os.fsencode(path.absolute())).hexdigest()[:16] / path.name
    if not copy.parent.exists():
        copy.parent.mkdir()
        if path.is_file():
            shutil.copyfile(path, copy)
    return copy


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write or replace a file in one step; one that is there keeps its permissions and, with sudo, its owner.

    The content is on the disk before the name is: whatever ends the program, or the battery, a reader finds
    the old file or the new one. A link stays one, and what it points to is replaced. What is no plain file
    (a device, a pipe, /dev/stdout) is written to as it is. Raises OSError, of the path that was given, where
    it cannot be written.
    """
    # The name of a file may be no text, and stand in a report of it.
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with replacing(path) as file:
        file.write(data)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write that gets the name `path` when the block ends; where it is left by an error nothing
    has happened. Otherwise as `write_atomically`.
    """
    with (
        naming_path(path),
        _open_stream(path) if is_stream(path) else _temporary_beside(Path(os.path.realpath(path))) as file,
    ):
        yield file


@contextmanager
def naming_path(path: Path) -> Iterator[None]:
    """An OSError inside names `path`: a full disk names no file, and nobody has heard of temporary ones."""
    try:
        yield
    except OSError as error:
        if isinstance(error, BrokenPipeError) or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


@contextmanager
def _temporary_beside(target: Path) -> Iterator[BinaryIO]:
    """A file beside the target that gets its name."""
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        mode = 0o644
        if target.exists():
            before = target.stat()
            mode = before.st_mode & 0o7777
            with suppress(PermissionError):  # of who is not root
                os.chown(temporary, before.st_uid, before.st_gid)
        os.chmod(temporary, mode)
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def is_stream(path: Path) -> bool:
    """Whether a path is no plain file to replace: a device, a pipe, or a file that is open already, such as
    /dev/stdout."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)) or _descriptor(path) is not None


def _open_stream(path: Path) -> BinaryIO:
    """What is there, to be written to. An open file goes on where it is, or one would overwrite the other."""
    number = _descriptor(path)
    sys.stdout.flush()
    return path.open("wb") if number is None else os.fdopen(os.dup(number), "wb")


def _descriptor(path: Path) -> int | None:
    """The number of the open file that a path leads to; None for any other."""
    for _ in range(MAX_LINKS):
        if os.path.realpath(path.parent) == f"/proc/{os.getpid()}/fd" and path.name.isdecimal():
            return int(path.name)
        if not path.is_symlink():
            return None
        path = path.parent / path.readlink()
    return None
