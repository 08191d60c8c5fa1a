"""The lock of the bus, against programs of other users and of other makers."""

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.link import lock
from raccoon.hal.wombat.link.lock import BusLock, refuse_other_owners


def test_one_program_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock, "WAIT_SECONDS", 0.0)
    first = BusLock("/dev/spidev7.0", folder=tmp_path)
    with pytest.raises(HardwareError, match=r"in use by this program itself: leave its first `with"):
        BusLock("/dev/spidev7.0", folder=tmp_path)
    (tmp_path / "raccoon-spidev7.0.lock").write_text(f"{os.getppid()}\n")  # as if that one had it
    with pytest.raises(HardwareError, match=rf"in use by another robot program \(process {os.getppid()}\)"):
        BusLock("/dev/spidev7.0", folder=tmp_path)
    first.release()
    first.release()
    BusLock("/dev/spidev7.0", folder=tmp_path).release()


def test_a_dead_program_leaves_no_lock(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from raccoon.hal.wombat.link.lock import BusLock;"
        " BusLock('/dev/spidev7.0', folder=Path(sys.argv[1])); os._exit(1)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    BusLock("/dev/spidev7.0", folder=tmp_path).release()


def test_the_lock_file_is_for_every_user(tmp_path: Path) -> None:
    path = tmp_path / "raccoon-spidev7.0.lock"
    before = os.umask(0o077)
    try:
        BusLock("/dev/spidev7.0", folder=tmp_path).release()
        assert path.stat().st_mode & 0o777 == 0o666
        path.chmod(0o644)  # of an older version
        BusLock("/dev/spidev7.0", folder=tmp_path).release()
        assert path.stat().st_mode & 0o777 == 0o666
    finally:
        os.umask(before)


def refusing(monkeypatch: pytest.MonkeyPatch, *ways: int) -> None:
    """The kernel as somebody meets it who may not open the file these ways, nor make one of this name."""
    opened = os.open

    def refuse(path: Path, flags: int, *mode: int) -> int:
        if flags & os.O_CREAT or flags & os.O_ACCMODE in ways:
            raise PermissionError(13, "Permission denied")
        return opened(path, flags, *mode)

    monkeypatch.setattr(os, "open", refuse)


def test_a_lock_file_of_another_user_is_locked_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "WAIT_SECONDS", 0.0)
    path = tmp_path / "raccoon-spidev7.0.lock"
    path.write_text("999999999\n")
    refusing(monkeypatch, os.O_RDWR)
    first = BusLock("/dev/spidev7.0", folder=tmp_path)
    with pytest.raises(HardwareError, match=r"in use by another robot program \(process unknown\)"):
        BusLock("/dev/spidev7.0", folder=tmp_path)
    first.release()
    BusLock("/dev/spidev7.0", folder=tmp_path).release()


def test_a_lock_file_that_may_not_even_be_read_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "raccoon-spidev7.0.lock"
    path.touch()
    refusing(monkeypatch, os.O_RDWR, os.O_RDONLY)
    with pytest.raises(HardwareError, match=f"Permission denied; delete it with `sudo rm {path}`"):
        BusLock("/dev/spidev7.0", folder=tmp_path)


@pytest.mark.parametrize("target", ["missing", "other"])
def test_a_link_in_place_of_the_lock_file_is_refused_and_what_it_names_stays(
    tmp_path: Path, target: str
) -> None:
    """One that leads nowhere was tried to be opened and to be made in turns, without end; and the file that
    another one named was made writable for everybody."""
    other, path = tmp_path / "other", tmp_path / "raccoon-spidev7.0.lock"
    other.write_text("kept")
    other.chmod(0o600)
    path.symlink_to(tmp_path / target)
    with pytest.raises(HardwareError, match=f"the lock file {path} .* delete it with `sudo rm {path}`"):
        BusLock("/dev/spidev7.0", folder=tmp_path)
    assert other.stat().st_mode & 0o777 == 0o600
    assert other.read_text() == "kept"
    assert not (tmp_path / "missing").exists()


def test_programs_of_root_and_of_the_user_meet_at_one_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where only root may write to the first folder, each of them had a lock of its own."""
    folders = tmp_path / "roots", tmp_path / "everybodys"
    for folder in folders:
        folder.mkdir()
    monkeypatch.setattr(lock, "LOCK_FOLDERS", folders)
    monkeypatch.setattr(lock, "WAIT_SECONDS", 0.0)
    may_write: list[Path] = [folders[1]]
    monkeypatch.setattr(os, "access", lambda folder, _mode: folder in may_write)
    users = BusLock("/dev/spidev7.0")
    may_write.append(folders[0])
    with pytest.raises(HardwareError, match="in use by this program itself"):
        BusLock("/dev/spidev7.0")
    users.release()
    (folders[1] / "raccoon-spidev7.0.lock").unlink()
    roots = BusLock("/dev/spidev7.0")
    del may_write[1:]
    with pytest.raises(HardwareError, match="in use by this program itself"):
        BusLock("/dev/spidev7.0")
    roots.release()


def process(proc: Path, number: int, name: str, opened: str | None = None) -> None:
    folder = proc / str(number) / "fd"
    folder.mkdir(parents=True)
    (proc / str(number) / "comm").write_text(f"{name}\n")
    if opened is not None:
        (folder / "3").symlink_to(opened)


def test_the_raccoon_service_is_named_with_the_cure(tmp_path: Path) -> None:
    process(tmp_path, 321, "stm32_data_read")  # names are cut to 15 characters
    with pytest.raises(HardwareError, match=r"process 321.*systemctl stop stm32_data_reader"):
        refuse_other_owners("/dev/spidev0.0", tmp_path)


def test_any_program_with_the_bus_open_is_named(tmp_path: Path) -> None:
    process(tmp_path, 322, "my_robot", "/dev/spidev0.0")
    with pytest.raises(HardwareError, match=r"my_robot \(process 322\).*kill 322"):
        refuse_other_owners("/dev/spidev0.0", tmp_path)


def test_who_still_stops_the_motors_of_a_dead_program_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    process(tmp_path, 326, "python3", "/dev/spidev7.0")  # its supervisor, which has the lock, too
    taken = iter([False, True])

    def flock(_descriptor: int, _operation: int) -> None:
        if not next(taken):
            raise BlockingIOError
        shutil.rmtree(tmp_path / "326")

    monkeypatch.setattr(fcntl, "flock", flock)
    BusLock("/dev/spidev7.0", folder=tmp_path, proc=tmp_path).release()


def test_the_screen_and_strangers_do_not_matter(tmp_path: Path) -> None:
    process(tmp_path, 323, "botui", "/dev/spidev0.0")
    process(tmp_path, 324, "other", "/dev/null")
    process(tmp_path, os.getpid(), "python", "/dev/spidev0.0")
    process(tmp_path, 325, "")
    (tmp_path / "325" / "comm").write_bytes("Überwachung_\N{WORLD MAP}".encode()[:15] + b"\n")
    process(tmp_path, 327, "of_root")
    (tmp_path / "327" / "fd").rmdir()  # its open files are not shown to others
    (tmp_path / "uptime").write_text("1")
    refuse_other_owners("/dev/spidev0.0", tmp_path)
