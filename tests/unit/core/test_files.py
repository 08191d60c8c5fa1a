"""A file appears whole, readable by others, or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from raccoon.core.config import load_robot
from raccoon.core.errors import ConfigError
from raccoon.core.files import (
    MAX_FILE_BYTES,
    copy_kept_files,
    kept_file,
    naming_path,
    read_bounded,
    write_atomically,
)


def test_text_and_bytes_arrive_as_they_are(tmp_path: Path) -> None:
    write_atomically(tmp_path / "text", "K_E \N{GREEK SMALL LETTER OMEGA}\n")
    write_atomically(tmp_path / "bytes", b"\x00\xff")
    assert (tmp_path / "text").read_text(encoding="utf-8") == "K_E \N{GREEK SMALL LETTER OMEGA}\n"
    assert (tmp_path / "bytes").read_bytes() == b"\x00\xff"


def test_a_report_may_name_a_file_whose_name_is_no_text(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.html", "b\udce4d.csv")
    assert (tmp_path / "a.html").read_text() == "b\\udce4d.csv"


def test_others_may_read_a_new_file_and_an_old_one_keeps_its_permissions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has them when it gets its name. By then the whole of it is on the disk, in the same folder."""
    new, old = tmp_path / "new", tmp_path / "old"
    synced: list[bytes] = []
    old.write_text("before")
    old.chmod(0o640)
    renamed: dict[Path, tuple[Path, int, bytes]] = {}
    replace = os.replace

    def rename(temporary: str, target: Path) -> None:
        renamed[target] = Path(temporary).parent, os.stat(temporary).st_mode & 0o777, synced.pop()
        replace(temporary, target)

    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(os.pread(descriptor, 99, 0)))
    monkeypatch.setattr(os, "replace", rename)
    for path in (new, old):
        write_atomically(path, "after")
    assert renamed == {new: (tmp_path, 0o644, b"after"), old: (tmp_path, 0o640, b"after")}
    assert new.stat().st_mode & 0o777 == 0o644
    assert old.stat().st_mode & 0o777 == 0o640


def test_a_file_that_sudo_replaces_stays_its_owners(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a program wrote as root, its team could edit no more."""
    path, given = tmp_path / "robot.toml", []

    def chown(_: str, user: int, group: int) -> None:
        given.append((user, group))
        raise PermissionError  # as for who is not root: it is theirs then, or stays another's

    monkeypatch.setattr(os, "chown", chown)
    write_atomically(path, "new")
    assert given == []
    write_atomically(path, "after")
    assert given == [(path.stat().st_uid, path.stat().st_gid)]
    assert path.read_text() == "after"


def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("before")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        write_atomically(path, "after")
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == ["robot.toml"]


def test_a_link_stays_and_what_it_points_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link, new = tmp_path / "there" / "out.json", tmp_path / "link", tmp_path / "new"
    target.write_text("before")
    link.symlink_to(target)
    new.symlink_to(tmp_path / "there" / "new.json")
    write_atomically(link, "after")
    write_atomically(new, "new")
    assert link.is_symlink()
    assert target.read_text() == "after"
    assert (tmp_path / "there" / "new.json").read_text() == "new"
    assert sorted(os.listdir(tmp_path / "there")) == ["new.json", "out.json"]


def test_a_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_atomically(pipe, "through ")
        write_atomically(link, "the pipe")
        assert os.read(reader, 100) == b"through the pipe"
    finally:
        os.close(reader)
    assert pipe.is_fifo()
    assert link.is_symlink()


def test_a_file_that_is_open_is_written_on(tmp_path: Path) -> None:
    path = tmp_path / "stdout.txt"
    with path.open("w") as file:
        file.write("said before\n")
        file.flush()
        write_atomically(Path(f"/dev/fd/{file.fileno()}"), "a result\n")
        file.write("said after\n")
    assert path.read_text() == "said before\na result\nsaid after\n"


def test_a_refusal_names_the_path_that_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied", str(tmp_path / ".out.json.x.part"))

    monkeypatch.setattr(tempfile, "mkstemp", refuse)
    with pytest.raises(PermissionError) as refused:
        write_atomically(tmp_path / "out.json", "after")
    assert refused.value.filename == str(tmp_path / "out.json")


def test_a_full_disk_names_the_path_that_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It said no more than that no space is left, somewhere."""

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    for path in (tmp_path / "out.json", Path("/dev/full")):
        with pytest.raises(OSError, match="No space left") as refused:
            write_atomically(path, "after")
        assert refused.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []


def test_what_never_ends_and_what_is_no_file_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program that was told to keep its calibrations in /dev/full read zeros until the memory was used
    up."""
    pipe, large = tmp_path / "pipe", tmp_path / "large"
    os.mkfifo(pipe)
    with large.open("wb") as file:
        file.truncate(MAX_FILE_BYTES + 1)
    for path in (Path("/dev/full"), pipe, tmp_path):
        with pytest.raises(ConfigError, match=f"{path}: it is a folder, a device or a pipe; name a file"):
            read_bounded(path, plain=True)
    for path in (Path("/dev/zero"), large):
        with pytest.raises(ConfigError, match=f"{path}: it has more than 32 MB"):
            read_bounded(path)
        with pytest.raises(ConfigError, match=f"^{path}: it has more than 32 MB"):
            load_robot(path)
    large.write_bytes(b"kept")
    assert read_bounded(large, plain=True) == read_bounded(large) == b"kept"


def test_what_has_no_name_gets_one() -> None:
    with pytest.raises(OSError, match="No space left") as refused, naming_path(Path("run.csv")):
        raise OSError(28, "No space left on device")
    assert refused.value.filename == "run.csv"
    with (
        pytest.raises(BrokenPipeError) as ended,
        naming_path(Path("run.csv")),
    ):  # nobody reads on: no fault of a file
        raise BrokenPipeError(32, "Broken pipe")
    assert ended.value.filename is None


def test_what_is_kept_apart_is_a_copy_for_as_long_as_that(tmp_path: Path) -> None:
    here, new = tmp_path / "here.json", tmp_path / "new" / "here.json"
    here.write_text("mine")
    with copy_kept_files():
        for _ in range(2):
            assert kept_file(here).read_text() == "mine"
        copy = kept_file(here)
        copy.write_text("its")
        kept_file(new).write_text("another")
        assert kept_file(here).read_text() == "its"
    assert here.read_text() == "mine"
    assert kept_file(here) == here
    assert not copy.exists()
    assert not new.exists()
