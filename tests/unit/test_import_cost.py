"""Importing the library and asking for help is cheap: on a Raspberry Pi everything heavy takes seconds."""

import subprocess
import sys

import pytest

HEAVY = ("numpy", "scipy", "sklearn", "filterpy", "matplotlib", "numba", "serial", "smbus2", "jinja2")
MEASURE = """
import resource, sys
def spent():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
before = spent()
{work}
print(spent() - before, *sorted(set({heavy!r}) & set(sys.modules)))
"""
HELP = """
from raccoon.cli import main
import contextlib, io
with contextlib.redirect_stdout(io.StringIO()):
    try:
        main(["--help"])
    except SystemExit as end:
        assert not end.code
"""


def measure(work: str) -> tuple[float, list[str]]:
    """CPU seconds of a statement in a fresh interpreter (best of three), and the heavy modules it loaded."""
    runs = []
    for _ in range(3):
        code = MEASURE.format(work=work, heavy=HEAVY)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        seconds, *loaded = done.stdout.split()
        runs.append((float(seconds), loaded))
    return min(runs)


@pytest.mark.parametrize(("work", "limit"), [("import raccoon", 0.15), (HELP, 0.3)], ids=["import", "help"])
def test_is_cheap_and_loads_nothing_heavy(work: str, limit: float) -> None:
    seconds, loaded = measure(work)
    assert loaded == []
    assert seconds < limit


def test_a_diagnosis_loads_no_more_of_scipy_than_a_search_needs() -> None:
    """These take 50 MB: on a Raspberry Pi 3 as much as the search itself."""
    large = ("scipy.signal", "scipy.stats", "scipy.optimize")
    code = f"import sys, raccoon.diagnose.diagnosis; print(*set({large!r}) & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
