"""What docs/match-day.md quotes is what the library says."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "match-day.md").read_text("utf-8")
SAID = re.compile(r"\s+").sub(
    " ",
    re.sub(
        r'"\s*\n\s*f?"',
        "",
        "\n".join(
            path.read_text("utf-8")
            for folder in ("src/raccoon", "examples")
            for path in sorted((ROOT / folder).rglob("*.py"))
        ),
    ),
)
ROWS = [line.split("|")[1] for line in PAGE.splitlines() if line.startswith("| `")]
QUOTES = [quote for row in ROWS for quote in re.findall(r"`([^`]+)`", row) if "front and left" not in quote]


@pytest.mark.parametrize("quote", QUOTES)
def test_it_quotes_what_is_said(quote: str) -> None:
    """Numbers and names are left out, as `...`."""
    for part in quote.split("..."):
        assert part.strip() in SAID
