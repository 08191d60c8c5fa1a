"""Files: atomic writing, and the folders in which a program's files are searched."""

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

from raccoon.core.errors import ConfigError

MAX_FILE_BYTES = 32 * 2**20
"""Largest file of settings or calibrations; these have a few kilobytes, and a device may never end."""
MAX_LINKS = 40
"""Maximum number of chained links, as in the operating system; more count as a ring."""


def program_folder() -> Path | None:
    """The folder of the running program; None if it is not a file."""
    program = getattr(sys.modules.get("__main__"), "__file__", None)
    return None if program is None else Path(program).absolute().parent


def near_program(name: str | Path) -> Path:
    """A file in the working directory, or beside the program if it exists only there: editors and services
    start programs in any directory. A path that exists in neither place stays as it is."""
    path, folder = Path(name), program_folder()
    if path.exists() or folder is None:
        return path
    beside = folder / path  # for an absolute path, the path itself
    return beside if beside.exists() else path


_copies: ContextVar[Path | None] = ContextVar("_copies", default=None)
"""The folder with copies of kept files; None: the files themselves are used."""


@contextmanager
def copy_kept_files() -> Iterator[None]:
    """Inside, the files that a program keeps from run to run (`kept_file`) are copies, which are deleted
    afterwards."""
    with tempfile.TemporaryDirectory(prefix="raccoon-") as folder:
        before = _copies.set(Path(folder))
        try:
            yield
        finally:
            _copies.reset(before)


def kept_file(name: str | Path) -> Path:
    """A file that a program keeps from run to run, searched as in `near_program`."""
    path, folder = near_program(name), _copies.get()
    if folder is None:
        return path
    copy = folder / hashlib.sha256(os.fsencode(path.absolute())).hexdigest()[:16] / path.name
    if not copy.parent.exists():
        copy.parent.mkdir()
        if path.is_file():
            shutil.copyfile(path, copy)
    return copy


def read_bounded(path: Path, *, plain: bool = False) -> bytes:
    """The content of a file of settings or calibrations, which a program reads whole. plain: it must be a
    plain file, because it is replaced later.

    Raises ConfigError naming the path for more than 32 MB, such as a device that never ends, and for anything
    else where a plain file is needed; FileNotFoundError and other OSErrors as `open` does.
    """
    if plain and not stat.S_ISREG(path.stat().st_mode):  # opening a pipe that nobody writes would block
        raise ConfigError(f"{path}: it is a folder, a device or a pipe; name a file")
    with path.open("rb") as file:
        content = file.read(MAX_FILE_BYTES + 1)
    if len(content) > MAX_FILE_BYTES:
        raise ConfigError(f"{path}: it has more than {MAX_FILE_BYTES >> 20} MB: name another file")
    return content


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write or replace a file in one step; an existing one keeps its permissions and, with sudo, its owner.

    The content is on the disk before the file gets its name: however the program ends, or the battery, a
    reader finds the old file or the new one. A link stays a link, and its target is replaced. Anything but a
    plain file (a device, a pipe, /dev/stdout) is written to directly. Raises OSError, naming the given path,
    if it cannot be written.
    """
    # A file name in the content may not be valid text.
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with replacing(path) as file:
        file.write(data)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write that gets the name `path` when the block ends; if an error leaves the block, nothing
    changes. Otherwise as `write_atomically`."""
    with (
        naming_path(path),
        _open_stream(path) if is_stream(path) else _temporary_beside(Path(os.path.realpath(path))) as file,
    ):
        yield file


@contextmanager
def naming_path(path: Path) -> Iterator[None]:
    """An OSError inside names `path`: that of a full disk names no file, and temporary names are of no
    use."""
    try:
        yield
    except OSError as error:
        if isinstance(error, BrokenPipeError) or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


@contextmanager
def _temporary_beside(target: Path) -> Iterator[BinaryIO]:
    """A file beside the target that replaces it at the end."""
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
            with suppress(PermissionError):  # without root rights
                os.chown(temporary, before.st_uid, before.st_gid)
        os.chmod(temporary, mode)
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def is_stream(path: Path) -> bool:
    """Whether a path is not a plain file that can be replaced: a device, a pipe, or a file that is open
    already, such as /dev/stdout."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)) or _descriptor(path) is not None


def _open_stream(path: Path) -> BinaryIO:
    """The stream, opened for writing. An open file continues at its position, otherwise it would be
    overwritten."""
    number = _descriptor(path)
    sys.stdout.flush()
    return path.open("wb") if number is None else os.fdopen(os.dup(number), "wb")


def _descriptor(path: Path) -> int | None:
    """The descriptor of the open file that a path leads to; None for any other path."""
    for _ in range(MAX_LINKS):
        if os.path.realpath(path.parent) == f"/proc/{os.getpid()}/fd" and path.name.isdecimal():
            return int(path.name)
        if not path.is_symlink():
            return None
        path = path.parent / path.readlink()
    return None
