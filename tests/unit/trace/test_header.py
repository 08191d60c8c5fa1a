"""The revision of a recorded program, from the files that git keeps."""

from pathlib import Path

import pytest

from raccoon.trace.header import git_revision

COMMIT, OTHER = "1" * 40, "2" * 40


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """One on the branch main, whose commit is COMMIT; with a folder in it."""
    (tmp_path / "team" / "src").mkdir(parents=True)
    git = tmp_path / "team" / ".git"
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "refs" / "heads" / "main").write_text(f"{COMMIT}\n")
    return tmp_path / "team"


def test_the_commit_of_the_branch_is_found_from_any_folder(repository: Path) -> None:
    assert git_revision(repository) == git_revision(repository / "src") == COMMIT


def test_refs_may_be_packed_and_a_head_detached(repository: Path) -> None:
    git = repository / ".git"
    (git / "refs" / "heads" / "main").unlink()
    (git / "packed-refs").write_text(f"# pack-refs\n{OTHER} refs/heads/old-main\n{COMMIT} refs/heads/main\n")
    assert git_revision(repository) == COMMIT
    (git / "HEAD").write_text(f"{OTHER}\n")
    assert git_revision(repository) == OTHER


def test_a_worktree_and_a_submodule_have_their_own(repository: Path) -> None:
    """Not that of the repository that they lie in."""
    git = repository / ".git"
    for name in ("tree", "module"):
        (repository / name / "src").mkdir(parents=True)
    own = git / "worktrees" / "tree"
    own.mkdir(parents=True)
    (own / "HEAD").write_text("ref: refs/heads/other\n")
    (own / "commondir").write_text("../..\n")
    (git / "refs" / "heads" / "other").write_text(f"{OTHER}\n")
    (repository / "tree" / ".git").write_text(f"gitdir: {own}\n")
    assert git_revision(repository / "tree" / "src") == OTHER
    (git / "modules" / "module").mkdir(parents=True)
    (git / "modules" / "module" / "HEAD").write_text(f"{'3' * 40}\n")
    (repository / "module" / ".git").write_text("gitdir: ../.git/modules/module\n")
    assert git_revision(repository / "module" / "src") == "3" * 40


@pytest.mark.parametrize("head", [None, b"ref: refs/heads/none\n", b"\xff\xfe"])
def test_what_is_damaged_or_no_repository_has_none(repository: Path, head: bytes | None) -> None:
    assert git_revision(Path("/proc")) is None
    (repository / ".git" / "HEAD").unlink()
    if head is not None:
        (repository / ".git" / "HEAD").write_bytes(head)
    assert git_revision(repository) is None
