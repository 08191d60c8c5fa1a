"""Recordings that a command is to read."""

from __future__ import annotations

import argparse
from pathlib import Path


def recording_path(text: str) -> Path:
    """A path of the command line; nothing (a variable of a script that is empty) is not the folder that the
    command is in."""
    if not text:
        raise argparse.ArgumentTypeError("the name of a recording is empty")
    return Path(text)
