"""What the diagnosis is tried on: rows of the table, each a stream of blind robots from seeds."""

from __future__ import annotations

import sys
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind.generator import Blind, Noise, make
from blind.hidden import CAUSES, UNKNOWN, Hidden, draw, draw_unknown
from blind.plant import NEUTRAL

TAIL = 20.0
"""s of drive after the recording, which the diagnosis never sees: what its gain is measured on."""
BACKGROUND = 0.15
"""Largest size of the others where everything is wrong at once."""
WORST_BACKGROUND = 0.1
"""The same for the worst case."""
LOOP = (0.0002, 0.0008)
"""Duty with which a program's wheel loop answers each count that a wheel is too slow, drawn between these."""

PROGRAM = "program"
"""Id of what is no fault, and so not hidden."""


@dataclass(frozen=True)
class Case:
    """One trial: row of the table, cause (or kind), and which of its trials it is."""

    row: str
    cause: str
    index: int

    @property
    def key(self) -> str:
        return f"{self.row}/{self.cause}/{self.index}"

    @classmethod
    def of(cls, key: str) -> Case:
        """The trial of a key."""
        row, _, rest = key.partition("/")
        cause, _, index = rest.rpartition("/")
        if row not in ROWS or cause not in ROWS[row].causes or not index.isdecimal():
            sys.exit(f"{key}: allowed are ROW/CAUSE/NUMBER, such as single/imu.latency/0")
        return cls(row, cause, int(index))

    def rng(self, seed: int) -> np.random.Generator:
        """Randomness of this trial alone: it does not depend on what else is run, or in which order."""
        return np.random.default_rng([seed, zlib.crc32(self.key.encode())])


@dataclass(frozen=True)
class Row:
    """A line of the table. causes: what is tried, each `share` times --trials."""

    causes: tuple[str, ...]
    share: float
    size: float = 1.0
    drive: str = "exciting"
    seconds: float = 40.0
    noise: float = 1.0
    tail: float = 0.0
    loop: bool = False


_ALL = tuple(CAUSES)
FIFTEEN = (
    "motor.back_emf_constant", "motor.heating", "battery.discharge", "friction.stiction",
    "friction.load_dependent", "friction.direction_dependent", "friction.quadratic", "drive.backlash",
    "drive.wheel_slip", "drive.wheel_radius", "drive.slope", "actuation.latency", "actuation.deadband",
    "imu.gyro_scale", "imu.gyro_drift",
)  # fmt: skip
"""The fewer causes among which the asked figures of "everything at once" were once measured."""
CLEAN = "none"
TWINS: Mapping[str, tuple[tuple[str, ...], frozenset[str]]] = {
    "imu.gyro_scale": (
        ("gyro_scale",),
        frozenset({"imu.gyro_scale", "drive.track_width", "drive.wheel_radius"}),
    ),
    "drive.track_width": (
        ("track",),
        frozenset({"imu.gyro_scale", "drive.track_width", "drive.wheel_radius"}),
    ),
    "drive.wheel_radius": (
        ("radius_l", "radius_r"),
        frozenset({"imu.gyro_scale", "drive.track_width", "drive.wheel_radius"}),
    ),
    "motor.armature_resistance": (
        ("resistance_l", "resistance_r"),
        frozenset({"motor.armature_resistance", "drive.inertia", "friction.coulomb"}),
    ),
}
"""Cause on the whole robot: the plant's numbers, and the class that must be reported."""

ROWS: Mapping[str, Row] = {
    "single": Row(_ALL, 1.0, tail=TAIL),
    "clean": Row((CLEAN,), 10.0),
    "clean_contest": Row((CLEAN,), 5.0, drive="contest", seconds=30.0),
    "clean_loop": Row((CLEAN,), 5.0, drive="contest", seconds=30.0, loop=True),
    "clean_short": Row((CLEAN,), 5.0, seconds=12.0),
    "two": Row(("two",), 10.0, tail=TAIL),
    "several": Row(("several",), 6.0, tail=TAIL),
    "fifteen": Row(("fifteen",), 4.0, tail=TAIL),
    "everything": Row(("everything",), 4.0, tail=TAIL),
    "small": Row(_ALL, 0.5, size=0.3),
    "contest": Row(_ALL, 0.5, drive="contest", seconds=30.0),
    "loop": Row(_ALL, 0.5, drive="contest", seconds=30.0, loop=True),
    "short": Row(_ALL, 0.5, seconds=12.0),
    "worst": Row(_ALL, 0.5, size=0.5, drive="contest", seconds=30.0, noise=2.0),
    "unmeasured": Row(("unmeasured",), 6.0, tail=TAIL),
    "unknown": Row(tuple(UNKNOWN), 2.0),
    "twins": Row(tuple(TWINS), 1.0),
    "advised": Row(_ALL, 0.5, seconds=10.0),
}


def cases(rows: list[str], trials: int) -> Iterator[Case]:
    """All cases, round by round and well mixed, so that a run that is cut short has some of everything."""
    wanted: list[tuple[float, int, Case]] = []
    for name in rows:
        row = ROWS[name]
        count = max(int(row.share * trials + 0.5), 1)
        for cause in row.causes:
            each = (Case(name, cause, index) for index in range(count))
            wanted.extend(((it.index + 0.5) / count, zlib.crc32(it.key.encode()), it) for it in each)
    wanted.sort(key=lambda each: each[:2])
    yield from (case for _, _, case in wanted)


def hidden_causes(case: Case, rng: np.random.Generator) -> list[Hidden]:
    """What is hidden in a case's robot: as its row has it, or its cause in the row's size."""
    if case.cause == CLEAN:
        return []
    hide = _HIDING.get(case.row)
    return [draw(case.cause, rng, ROWS[case.row].size)] if hide is None else hide(case, rng)


def make_recording(case: Case, seed: int) -> Blind:
    """A case's recording."""
    rng = case.rng(seed)
    return recording(case, hidden_causes(case, rng), rng)


def _twin(cause: str, rng: np.random.Generator) -> Hidden:
    factor = 1.0 + float(rng.uniform(0.06, 0.12) * rng.choice([-1.0, 1.0])) * (
        2.0 if cause.startswith("motor") else 1.0
    )
    return Hidden(cause, None, {"factor": factor}, {each: NEUTRAL[each] * factor for each in TWINS[cause][0]})


UNMEASURED: Mapping[str, tuple[tuple[str, ...], float, float]] = {
    "drive.wheel_radius": (("radius_l", "radius_r"), 0.9, 1.1),
    "drive.track_width": (("track",), 0.85, 1.2),
    "drive.inertia": (("inertia_straight", "inertia_turn"), 0.6, 1.6),
    "friction.coulomb": (("coulomb",), 0.7, 1.4),
    "motor.back_emf_constant@left": (("ke_l",), 0.95, 1.04),
    "motor.back_emf_constant@right": (("ke_r",), 0.95, 1.04),
    "motor.armature_resistance@left": (("resistance_l",), 0.92, 1.12),
    "motor.armature_resistance@right": (("resistance_r",), 0.92, 1.12),
    "battery.open_circuit_voltage": (("voc",), 0.93, 1.045),
}
"""Of a robot whose team has written nothing into its robot.toml: each cause, the plant's numbers, and between
which parts of what is assumed they are. Motors and battery as far apart as measured ones."""
OFFSET, BIAS = 40.0, 0.005
"""Counts and rad/s that its readings may have at rest."""


def _all_off(rng: np.random.Generator) -> list[Hidden]:
    found = []
    for name, (plant, low, high) in UNMEASURED.items():
        id_, _, where = name.partition("@")
        factor = float(rng.uniform(low, high))
        values = {each: NEUTRAL[each] * factor for each in plant}
        found.append(Hidden(id_, where or None, {"factor": factor}, values))
    for side in ("left", "right"):
        counts = float(rng.uniform(-OFFSET, OFFSET))
        found.append(Hidden("bemf.offset", side, {"counts": counts}, {f"bemf_offset_{side[0]}": counts}))
    rate = float(rng.uniform(-BIAS, BIAS))
    return [*found, Hidden("imu.gyro_bias", None, {"rate": rate}, {"gyro_bias": rate})]


def _shuffled(rng: np.random.Generator, causes: tuple[str, ...] = _ALL) -> list[str]:
    return [causes[index] for index in rng.permutation(len(causes))]


def _background_share(rng: np.random.Generator, index: int) -> float:
    return 1.0 if index == 0 else float(rng.uniform(0.0, BACKGROUND))


def _different_causes(rng: np.random.Generator, count: int) -> list[Hidden]:
    return [draw(each, rng) for each in _shuffled(rng)[:count]]


def recording(case: Case, hidden: list[Hidden], rng: np.random.Generator) -> Blind:
    """The blind robot's drive: the recording and the tail behind it."""
    row = ROWS[case.row]
    program = [Hidden(PROGRAM, None, {}, {"speed_loop": float(rng.uniform(*LOOP))})] if row.loop else []
    blind = make(
        int(rng.integers(2**31)),
        [*hidden, *program],
        drive=row.drive,
        seconds=row.seconds + row.tail,
        noise=Noise().times(row.noise),
    )
    return replace(blind, hidden=tuple(each for each in blind.hidden if each.id != PROGRAM))


def _all_together(case: Case, rng: np.random.Generator) -> list[Hidden]:
    causes = _shuffled(rng, FIFTEEN if case.row == "fifteen" else _ALL)
    return [draw(each, rng, _background_share(rng, index)) for index, each in enumerate(causes)]


def _among_small_ones(case: Case, rng: np.random.Generator) -> list[Hidden]:
    found = draw(case.cause, rng, ROWS[case.row].size)
    others = [each for each in _shuffled(rng) if each != case.cause]
    return [found, *(draw(each, rng, float(rng.uniform(0.0, WORST_BACKGROUND))) for each in others)]


_HIDING: Mapping[str, Callable[[Case, np.random.Generator], list[Hidden]]] = {
    "unknown": lambda case, rng: [draw_unknown(case.cause, rng)],
    "twins": lambda case, rng: [_twin(case.cause, rng)],
    "unmeasured": lambda _, rng: _all_off(rng),
    "two": lambda _, rng: _different_causes(rng, 2),
    "several": lambda _, rng: _different_causes(rng, int(rng.integers(3, 6))),
    "fifteen": _all_together,
    "everything": _all_together,
    "worst": _among_small_ones,
}
"""Rows in which more or other than one cause of the row's size is hidden."""
