"""Every link on the pages leads to a file that is there, and to a heading that is on it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"(?<!\\)\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The names that a page's headings have in links: lower case, blanks as hyphens, no other signs."""
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in HEADING.findall(text)}


def broken(page: Path) -> list[str]:
    """The links of a page that lead nowhere."""
    found = []
    for target in LINK.findall(CODE.sub("", page.read_text("utf-8"))):
        if target.startswith(("https://", "http://")):
            continue
        path, _, name = target.partition("#")
        other = (page.parent / path).resolve() if path else page
        if not other.exists() or (name and name not in anchors(other)):
            found.append(target)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    assert broken(page) == []


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# One thing, and more\n[a](#one-thing-and-more) [b](#another) [c](gone.md) `[d](x)`\n")
    assert broken(page) == ["#another", "gone.md"]


def test_a_page_that_the_library_names_is_there_and_has_what_it_is_named_for() -> None:
    text = "\n".join(path.read_text("utf-8") for path in (ROOT / "src").rglob("*.py"))
    named = re.findall(r"(docs/[\w/-]+\.md)(?: on ([a-z -]+))?", text)
    assert ("docs/hardware.md", "real-time priority") in named
    assert ("docs/hardware-i2c-serial.md", "") in named  # where a Create is not reached
    for page, about in named:
        assert about in (ROOT / page).read_text("utf-8"), (page, about)
