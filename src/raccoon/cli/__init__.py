"""The command line: one file or folder a command, heavy imports inside."""

from raccoon.cli.main import main

__all__ = ["main"]
