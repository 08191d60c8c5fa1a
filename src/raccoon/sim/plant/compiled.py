"""The plant's equations, compiled by numba if it is installed and as plain Python otherwise.

numba's cache checks only the file of a compiled function, not the files of the functions it calls, so it
would miss a changed equation. All functions are therefore put into one generated module whose name is a
digest of their text.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import logging
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from raccoon.core.files import write_atomically
from raccoon.sim.plant.lanes import KINDS, LOOSE, Kind, lanes_text
from raccoon.sim.plant.quantities import Plant, State

Advance = Callable[..., Any]
ANY = Kind()
NOT_KEPT = "nothing can be written in {} (the variable RACCOON_CACHE names another folder)"
INNER = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba for functions that only compiled functions call. Making a function callable from Python
takes a third of its compilation time."""
_SHARED: dict[str, Any] = {}  # by digest: texts for different robots have most of their functions in common
_TEXTS = ("series.py", "friction.py", "equations.py", "sensing.py", "driver.py")
_HEAD = """from __future__ import annotations

from math import sqrt

from raccoon.sim.plant.quantities import Circuit, Command, Plant, Rubbing, State

NEVER = 1e30
"""


def has_numba() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


def given(numbers: ArrayLike) -> Any:
    """Numbers in the form that `advance_one` takes: a NumPy array if it is compiled, otherwise Python's lists
    and floats.

    Single NumPy numbers are several times slower, and warn of inf * 0, which the equations contain on purpose
    (an infinite current limit times the closed share 0 of an open bridge).
    """
    array = np.ascontiguousarray(numbers)
    return array if has_numba() else array.tolist()


def source(kind: Kind = ANY) -> str:
    """Source text of all functions of the plant, for robots of a kind."""
    texts = [files("raccoon.sim.plant").joinpath(name).read_text("utf-8") for name in _TEXTS]
    tags = [f"# effect: {each}" for each in kind.without]
    tags += [f"# without effect: {each}" for each in kind.always]
    if kind is not ANY:
        tags.append("# world: contact")  # robots in lanes have no table
    if set(LOOSE) <= set(kind.without):
        tags.append("# chain: whole")  # they run where loose ones do: `_blocks` of `rollout.running`
    if not kind.creeping:
        tags.append("# creeping")
    texts = [_without(text, tuple(tags)) for text in texts]
    return "\n\n".join((_HEAD, *map(_functions, texts), _cells_text(), lanes_text(kind.unfollowed)))


def _cells_text() -> str:
    """Source text of `advance_cells`: `driver.advance` with the fields of state and plant in two arrays, the
    first of which it updates. numba accepts an array in a moment; a hundred separate fields take it ten
    times as long as a step.

    It returns nothing: to build a tuple, numba calls Python after the compiled function, and if a signal
    handler raises there (Ctrl-C, SIGTERM, the end of a match), it continues with a missing result and
    crashes.
    """
    state, plant = (
        ", ".join(f"{name}[{index}]" for index in range(len(fields)))
        for name, fields in (("state", State._fields), ("plant", Plant._fields))
    )
    course = "commands, times, begin, end, cycle, longest_step, slots, noise, kept, out"
    stores = "\n".join(f"    state[{index}] = s[{index}]" for index in range(len(State._fields)))
    return (
        f"def advance_cells(state, plant, {course}):\n"
        f"    s = advance(State({state}), Plant({plant}), {course})\n{stores}"
    )


def _functions(text: str) -> str:
    nodes = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    lines = text.split("\n")
    return "\n\n\n".join("\n".join(lines[node.lineno - 1 : node.end_lineno]) for node in nodes)


def _without(text: str, tags: tuple[str, ...]) -> str:
    """A text without the assignments that end with one of these tags."""
    lines: list[str | None] = list(text.split("\n"))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Assign | ast.AugAssign) and node.end_lineno is not None:
            last = lines[node.end_lineno - 1]
            if last is not None and last.endswith(tags):
                lines[node.lineno - 1 : node.end_lineno] = [None] * (node.end_lineno - node.lineno + 1)
    return "\n".join(line for line in lines if line is not None)


def python_module(text: str) -> ModuleType:
    """A module with the functions of a text, not compiled."""
    module = ModuleType("raccoon_plant")
    exec(compile(text, "<plant>", "exec"), module.__dict__)
    return module


def advance_one() -> Advance:
    """`driver.advance`, compiled if numba is installed. Make one for each robot: it remembers the robot's
    last state."""
    from raccoon.sim.plant import driver

    return Advancing(advance_cells()) if has_numba() else driver.advance


class Advancing:
    """`driver.advance` in its compiled form. State and plant stay in its arrays between calls and are copied
    into them only when the caller passes other ones."""

    def __init__(self, compiled: Advance) -> None:
        self._compiled = compiled
        self._cells, self._numbers = np.zeros(len(State._fields)), np.zeros(len(Plant._fields))
        self._state: State | None = None
        self._plant: Plant | None = None

    def __call__(self, state: State, plant: Plant, *course: Any) -> State:
        # Whatever raises between two of these lines (Ctrl-C), the next call starts from what it is given.
        if state is not self._state:
            self._cells[:] = state
        if plant is not self._plant:
            self._plant = None
            self._numbers[:] = plant
            self._plant = plant
        self._state = None
        self._compiled(self._cells, self._numbers, *course)
        after = State._make(self._cells.tolist())
        self._state = after
        return after


@cache
def advance_cells() -> Advance:
    """The compiled function `advance_cells`, which `Advancing` calls."""
    # A warning, since a program that starts shows no other remark, and would seem to hang.
    return announced(_made(source()).advance_cells, "the simulator", logging.WARNING)


@cache
def advance_lanes(kind: str) -> Advance:
    """The form of `driver.advance` for many robots (see `lanes`). kind: of the robots, a key of `KINDS`.

    If it has to be compiled first, which takes some seconds, that is logged (logger raccoon, info).
    """
    made: Advance = _made(source(KINDS[kind])).advance_lanes
    return announced(made, f"the simulator of {kind}", logging.INFO) if has_numba() else made


@cache
def vector() -> int:
    """Number of robots that the vector unit computes at once. Robots beyond a whole number of vectors would
    be computed one by one, which costs more than idle lanes do."""
    from llvmlite.binding import get_host_cpu_features

    return 8 if get_host_cpu_features().get("avx512f") else 4


@cache
def _made(text: str) -> Any:
    """The module of a text, compiled if numba is installed; the same module for every function taken from
    it."""
    return compiled_module(text) if has_numba() else python_module(text)


def compiled_module(text: str) -> Any:
    """A module with the functions of a text compiled on first use. The result is cached between runs if the
    cache folder can be written."""
    import numba

    log = logging.getLogger("numba")
    if log.level == logging.NOTSET:  # a program that logs at DEBUG would get thousands of lines
        log.setLevel(logging.WARNING)
    module, cached = _module(text)
    functions = {name: each for name, each in vars(module).items() if isinstance(each, FunctionType)}
    for name, digest in _digests(functions).items():
        function = functions[name]
        if name in ("advance_cells", "advance_lanes"):
            made = numba.njit(error_model="numpy", nogil=True)(function)
            if cached:
                # Not where nothing can be written beside the file, nor in the user's folder.
                with suppress(RuntimeError):
                    made.enable_caching()
        elif digest in _SHARED:
            made = _SHARED[digest]
        else:
            # numba's cache imports the module of each function again, which may be another text's, and takes
            # functions of one name for the same one.
            function.__module__, function.__qualname__ = __name__, f"{name}_{digest}"
            made = _SHARED[digest] = numba.njit(error_model="numpy", **INNER)(function)
        setattr(module, name, made)
    return module


def _digests(functions: Mapping[str, FunctionType]) -> dict[str, str]:
    """For each function, a digest of its code and that of all functions that it calls, directly or
    indirectly."""
    codes = {name: each.__code__ for name, each in functions.items()}
    texts = {
        name: repr((name, code.co_varnames, code.co_names, code.co_consts, code.co_code))
        for name, code in codes.items()
    }
    called = {name: functions.keys() & set(code.co_names) for name, code in codes.items()}
    digests = {}
    for name in functions:
        reached: set[str] = set()
        new = {name}
        while new:
            reached |= new
            new = {other for each in new for other in called[each]} - reached
        whole = "\n".join(texts[each] for each in sorted(reached))
        digests[name] = hashlib.sha256(whole.encode()).hexdigest()[:16]
    return digests


def announced(function: Any, what: str, level: int) -> Advance:
    """The given function, which from now on logs (logger "raccoon") when it is really compiled, but not when
    numba finds it in a cache."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]  # numba has no types
        def on_start(self, event: Any) -> None:
            if event.data["dispatcher"] is function:
                kept = function.stats.cache_path is not None
                often = "the first time only" if kept else f"each time: {NOT_KEPT.format(cache_folder())}"
                logging.getLogger("raccoon").log(level, "compiling %s, %s", what, often)

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Listener())
    advance: Advance = function
    return advance


def _module(text: str) -> tuple[ModuleType, bool]:
    """The module of a text, and whether it is stored in a file, beside which numba can keep its cache."""
    name = f"raccoon_plant_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    try:
        path = _written(cache_folder() / f"{name}.py", text)
    except OSError:
        return python_module(text), False
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path}: cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module, True


def cache_folder() -> Path:
    """Folder of compiled plants: RACCOON_CACHE, or raccoon in the user's cache folder."""
    chosen = os.environ.get("RACCOON_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(chosen) if chosen else Path(base).expanduser() / "raccoon"


def _written(path: Path, text: str) -> Path:
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    return path
