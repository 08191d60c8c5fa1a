"""Isolates the process state: what a program changes does not reach the next match, or the process that plays
it."""

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
    """Run a program without output and input, with random numbers by the match's seed, and with the folder
    and environment that the first match found. Other threads share all of these, so in them nothing is
    changed."""
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
    """Random numbers of `random` and `numpy.random` follow from the match's seed, and the caller's sequences
    continue as if there had been no match."""
    import numpy as np

    before, before_numpy = random.getstate(), np.random.get_state()
    random.seed(seed)
    np.random.seed(seed % 2**32)
    try:
        yield
    finally:
        random.setstate(before)
        np.random.set_state(before_numpy)
