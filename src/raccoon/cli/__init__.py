"""The command line `raccoon`: one module or package per command, with heavy imports inside its functions."""

from raccoon.cli.main import main

__all__ = ["main"]
