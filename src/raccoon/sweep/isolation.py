"""Keeps what a program does to its process out of the next match, and of whoever plays it."""

from __future__ import annotations

import io
import os
import random
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path


@contextmanager
def isolated_process_state(seed: int) -> Iterator[None]:
    """What a program prints is lost, nobody answers it, it draws by the match's seed, and each match finds
    the folder and the environment that the first one found. Other threads share all of that, so in them it is
    left alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _silenced_streams(), _restored_environment(), _seeded_random(seed):
        yield


@contextmanager
def _silenced_streams() -> Iterator[None]:
    """`input` raises EOFError, in a worker as at a terminal."""
    before = sys.stdin
    try:
        with open(os.devnull) as sys.stdin, redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            yield
    finally:
        sys.stdin = before


@contextmanager
def _restored_environment() -> Iterator[None]:
    folder, environment = Path.cwd(), dict(os.environ)
    try:
        yield
    finally:
        os.chdir(folder)
        for name in os.environ.keys() - environment.keys():
            del os.environ[name]
        os.environ.update(environment)


@contextmanager
def _seeded_random(seed: int) -> Iterator[None]:
    """What a program draws from `random` and `numpy.random` follows from the match's seed, and a caller's
    draws go on as if there had been no match."""
    import numpy as np

    before, before_numpy = random.getstate(), np.random.get_state()
    random.seed(seed)
    np.random.seed(seed % 2**32)
    try:
        yield
    finally:
        random.setstate(before)
        np.random.set_state(before_numpy)
