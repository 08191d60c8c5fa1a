"""The lock of the bus, which gives it to one program at a time, and the detection of other programs that use
it."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from raccoon.core.errors import HardwareError

LOCK_FOLDERS = (Path("/run/lock"), Path("/var/lock"), Path("/tmp"))
RACCOON_READER = "stm32_data_reader"
"""Name of RaccoonOS's own service. The kernel cuts names of processes to `COMM_LENGTH` characters."""
SCREEN = "botui"
"""Name of the program of the controller's screen. It reads the bus between raccoon's frames; that does no
harm, because each of these holds the complete command."""
COMM_LENGTH = 15
PLAIN = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
"""Flags of the lock file. A link in its place is refused: whoever may write to the folder could have any file
of root made writable; opening a pipe would wait for its other end."""
WAIT_SECONDS = 1.0
"""s to wait for the lock: the supervisor of a program that was just killed holds it until the motors are
stopped."""


class BusLock:
    """Exclusive use of a device among programs of this library, from construction to `release`.

    Raises HardwareError if another program owns the bus; the message names it and says what to do.
    """

    def __init__(self, device: str, *, folder: Path | None = None, proc: Path = Path("/proc")) -> None:
        path = _lock_path(f"raccoon-{Path(device).name}.lock", (folder,) if folder else LOCK_FOLDERS)
        try:
            self.descriptor = _open_for_all(path)
        except OSError as error:
            raise HardwareError(
                f"the lock file {path} of {device} cannot be opened: {error.strerror}; delete it with"
                f" `sudo rm {path}`, where no robot program runs"
            ) from error
        try:
            self._acquire(device)
            # After the lock: a supervisor has the bus open until it has stopped its dead program's motors.
            refuse_other_owners(device, proc)
        except BaseException:
            os.close(self.descriptor)
            raise
        self._held = True
        with suppress(OSError):  # only a note for others; another user's file can be locked but not written
            os.ftruncate(self.descriptor, 0)
            os.pwrite(self.descriptor, f"{os.getpid()}\n".encode(), 0)

    def _acquire(self, device: str) -> None:
        give_up = time.monotonic() + WAIT_SECONDS
        while True:
            try:
                fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            except BlockingIOError:
                if time.monotonic() > give_up:
                    raise HardwareError(f"{device} is in use by {self._owner()}") from None
                time.sleep(0.02)
            except OSError as error:
                raise HardwareError(f"the lock of {device} cannot be taken: {error}") from error

    def _owner(self) -> str:
        """The owner that the lock file names, if its process exists, and what to do."""
        owner = os.pread(self.descriptor, 32, 0).decode("ascii", "replace").strip()
        if owner == str(os.getpid()):
            return "this program itself: leave its first `with open_robot(...)` before the next"
        known = owner.isdigit() and Path("/proc", owner).exists()
        return f"another robot program (process {owner if known else 'unknown'}): stop it first"

    def release(self) -> None:
        """Release the lock for others. May be called twice."""
        if self._held:
            self._held = False
            os.close(self.descriptor)


def _open_for_all(path: Path) -> int:
    """Open the lock file and make it lockable by every user, whoever created it.

    The file of a program that was started with sudo must not lock out the team's own user, nor the other way
    round: in a folder like /run/lock the kernel refuses O_CREAT on another user's file, even to root.
    """
    while True:
        try:
            descriptor = os.open(path, os.O_RDWR | PLAIN)
        except PermissionError:
            return os.open(path, os.O_RDONLY | PLAIN)  # enough for a lock
        except FileNotFoundError:
            try:
                descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | PLAIN, 0o666)
            except FileExistsError:  # another program created it in between
                continue
        with suppress(PermissionError):  # the file is another user's
            os.fchmod(descriptor, 0o666)  # the umask has removed some of these bits
        return descriptor


def _lock_path(name: str, folders: Sequence[Path]) -> Path:
    """The lock file that exists, or else one in the first folder that is writable: where only root may write
    to the first folder, a program of root and one of the team's user must still meet at one file."""
    made = next((folder / name for folder in folders if os.path.lexists(folder / name)), None)
    if made is not None:
        return made
    for folder in folders:
        if os.access(folder, os.W_OK):
            return folder / name
    raise HardwareError(f"no folder for a lock file: {', '.join(map(str, folders))} are not writable")


def refuse_other_owners(device: str, proc: Path = Path("/proc")) -> None:
    """Raise HardwareError if a process that this library cannot share the bus with has it open.

    Only root sees the open files of other users, so RaccoonOS's service is recognised by its name as well.
    """
    for process in proc.iterdir():
        if not process.name.isdigit() or int(process.name) == os.getpid():
            continue
        name = _process_name(process)
        if name == RACCOON_READER[:COMM_LENGTH]:
            raise HardwareError(
                f"{RACCOON_READER} (process {process.name}) owns {device}: stop it with"
                " `sudo systemctl stop stm32_data_reader` before running this program"
            )
        if name != SCREEN and _has_open(process, device):
            raise HardwareError(
                f"{name or 'a program'} (process {process.name}) has {device} open: stop it with"
                f" `kill {process.name}` before running this program"
            )


def _process_name(process: Path) -> str:
    try:
        # The kernel cuts names to bytes, also in the middle of a letter.
        return (process / "comm").read_text("utf-8", "replace").strip()
    except OSError:  # it has ended meanwhile
        return ""


def _has_open(process: Path, device: str) -> bool:
    try:
        return any(_link_target(entry) == device for entry in (process / "fd").iterdir())
    except OSError:  # not ours to look at, or it has ended meanwhile
        return False


def _link_target(entry: Path) -> str:
    try:
        return os.readlink(entry)
    except OSError:
        return ""
