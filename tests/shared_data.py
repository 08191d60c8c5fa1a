"""Where the recordings are, for tests that read them; such a test skips where they are absent."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def data_path(name: str) -> Path:
    """Folder or file `name` of the recordings; skips the calling test with the reason where it is absent."""
    base = Path(os.environ.get("RACCOON_SHARED_DATA", ROOT.parent / "shared" / "data"))
    path = base / name
    if not path.exists():
        pytest.skip(f"no recordings at {path}: set RACCOON_SHARED_DATA to the folder that holds {name}")
    return path
