"""The type of command-line arguments that name recordings."""

from __future__ import annotations

import argparse
from pathlib import Path


def recording_path(text: str) -> Path:
    """A path from the command line. An empty text, such as an empty variable of a script, is refused: it
    would mean the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("the name of a recording is empty")
    return Path(text)
