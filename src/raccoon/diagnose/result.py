"""Result of a diagnosis: frozen data, the same as its JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raccoon.core.files import write_atomically
from raccoon.diagnose.hypotheses.coordinates import cause_name
from raccoon.sim.effects.parameters import Parameters

Array = NDArray[np.float64]

WORST_STRETCH_S = 0.5
"""Length in s of the interval that a report names as the one with the largest error."""
MIN_VISIBLE_CHANGE = 0.05
"""Change of a reading, in units of its noise, below which a cause does not matter. For a gyro that is 4
degrees in a match of two minutes, if it never averages out."""
MIN_LAG_S = 0.003
"""Lag in s below which it does not matter: half a cycle of a firmware at 175 Hz. The time in its cycle at
which a controller reads and acts makes as much difference, and a robot at 0.3 m/s drives 1 mm in it."""
PWM_STEP_DUTY = 1.0 / 400.0
"""Duty of one step of a Wombat's PWM, with either firmware. A narrower deadband affects no command that can
be given."""
_NEGLIGIBLE_BELOW = {
    "actuation.latency": ("seconds", MIN_LAG_S, "less than half a cycle"),
    "imu.latency": ("seconds", MIN_LAG_S, "less than half a cycle"),
    "drive.wheel_slip": ("time", MIN_LAG_S, "less than half a cycle"),
    "actuation.deadband": ("duty", PWM_STEP_DUTY, "less than a step of the PWM"),
}
"""By cause: the parameter, the deviation below which it does not matter however clearly readings show it, and
the reason in words."""

STOOD, NO_DUTY = "stood", "speed"
"""Faults of a motor that did not turn although it was driven, and of a command that is no duty."""
SAME_ROBOT = "is it the same robot, with the same battery and load?"
"""End of the note on a held-out recording that does not confirm what was found; a report begins with it."""
MAX_UNEXPLAINED_SHARE = 0.3
"""Share of the possible gain that is not explained, from which a recording counts as explained in part
only."""


class Verdict(StrEnum):
    """The verdict in one word."""

    EXPLAINED = "explained"
    """The causes account for the simulation's error."""
    PARTLY = "partly"
    """The causes account for a part of the error; the rest depends on something outside the catalogue."""
    UNKNOWN = "unknown"
    """The simulation is wrong, and no cause of the catalogue explains it."""
    ADEQUATE = "adequate"
    """Nothing that matters is wrong; causes that are real but do not matter may be named."""
    NOT_IDENTIFIABLE = "not_identifiable"
    """This recording does not contain enough information."""


@dataclass(frozen=True, slots=True)
class ChannelResult:
    """RMS errors of one sensor, in its unit, on held-out data. whiteness_p: p-value of a test that the
    remaining residual is white; NaN if it was not tested."""

    name: str
    unit: str
    rmse_before: float
    rmse_after: float
    noise_floor: float
    whiteness_p: float = math.nan


@dataclass(frozen=True, slots=True)
class ParameterResult:
    """A fitted number with its standard deviation; nominal: the value that the simulation assumed."""

    value: float
    std: float
    unit: str
    nominal: float


@dataclass(frozen=True, slots=True)
class Gain:
    """Error on held-out data without and with a cause, over all channels, in units of their noise; no half
    second counts for more than four usual ones.

    share: of the whole possible gain.
    """

    heldout_rmse_before: float
    heldout_rmse_after: float
    share: float


@dataclass(frozen=True, slots=True)
class CauseResult:
    """A named cause.

    change: RMS change of the reading in which it shows most, in units of that reading's noise. unabsorbed:
    RMS change of all readings together that robot.toml's deviations cannot absorb; causes that matter are
    ranked by it. Both are NaN if no drive was recorded. beside: those of confounded_with that may act beside
    it with a part of it, and not in its place.
    """

    id: str
    where: str | None
    rank: int
    parameters: Mapping[str, ParameterResult]
    gain: Gain
    probability: float
    confounded_with: tuple[str, ...]
    explanation: str
    change: float = math.nan
    unabsorbed: float = math.nan
    beside: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """id, or id@where."""
        return cause_name(self.id, self.where)

    @property
    def is_negligible(self) -> bool:
        """Whether it is real but does not matter: readings would be nearly the same without it, or its number
        is too small for any robot to notice or for any command to be affected."""
        return self.change < MIN_VISIBLE_CHANGE or bool(self.negligible_reason)

    @property
    def negligible_reason(self) -> str:
        """Reason why its number does not matter, however clearly readings show it; "" if it does."""
        name, size, why = _NEGLIGIBLE_BELOW.get(self.id, ("", 0.0, ""))
        number = self.parameters.get(name)
        return why if number is not None and abs(number.value - number.nominal) < size else ""

    def to_dict(self) -> dict[str, Any]:
        """As plain types; change and unabsorbed are included if a drive was recorded, beside if it is not
        empty."""
        there = {"change": math.isfinite(self.change), "beside": bool(self.beside)}
        there["unabsorbed"] = there["change"]
        return {key: it for key, it in asdict(self).items() if there.get(key, True)}


@dataclass(frozen=True, slots=True)
class Rejected:
    """A cause that is not named, and the reason."""

    id: str
    reason: str


@dataclass(frozen=True, slots=True)
class Unexplained:
    """The unexplained part: its share of the error that could be removed, and the quantities on which it
    depends."""

    share: float
    depends_on: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Shape:
    """Curve of an effect outside the catalogue: a quantity (in unit) over what it depends on, in ascending
    order, with standard deviations. Arrays (points,)."""

    depends_on: str
    quantity: str
    unit: str
    over: Array
    over_unit: str
    values: Array
    stds: Array

    @property
    def size(self) -> ParameterResult:
        """Difference between its highest and lowest value."""
        low, high = int(np.argmin(self.values)), int(np.argmax(self.values))
        std = math.hypot(self.stds[low], self.stds[high])
        return ParameterResult(float(self.values[high] - self.values[low]), std, self.unit, 0.0)

    @property
    def highest(self) -> float:
        """Position of its highest value, in over_unit."""
        return float(self.over[int(np.argmax(self.values))])

    def to_dict(self) -> dict[str, Any]:
        """As plain types."""
        return {
            "depends_on": self.depends_on, "quantity": self.quantity, "unit": self.unit,
            "over_unit": self.over_unit, "size": {"value": self.size.value, "std": self.size.std},
            **{name: getattr(self, name).tolist() for name in ("over", "values", "stds")},
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A broken or degraded sensor, or a motor that did not follow its command. channel: its column. fault:
    one word, such as dead, stale, repeats, stood or speed. text: one sentence."""

    channel: str
    fault: str
    text: str

    @property
    def kind(self) -> str:
        """What is faulty, in a word."""
        return {STOOD: "Motor", NO_DUTY: "Commands"}.get(self.fault, "Sensor")


@dataclass(frozen=True, slots=True)
class Curve:
    """One channel for a plot: measured, and simulated without and with the causes; NaN where unknown."""

    name: str
    unit: str
    time: Array
    measured: Array
    before: Array
    after: Array

    @property
    def worst(self) -> float:
        """Middle (s) of the half second with the largest error of the simulation with the causes."""
        square = np.nan_to_num(self.after - self.measured) ** 2
        part = ((self.time - self.time[0]) / WORST_STRETCH_S).astype(int)
        power = np.bincount(part, square) / np.maximum(np.bincount(part), 1)
        return float(self.time[0] + (int(np.argmax(power)) + 0.5) * WORST_STRETCH_S)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The results for one recording. model: the simulation with the causes in it (not part of the JSON).
    identified: numbers that were measured without being a cause, by name. sensor_faults: faults of the
    readings instead of the robot. curves: measured and simulated, for plots. shapes: of effects outside the
    catalogue."""

    verdict: Verdict
    channels: tuple[ChannelResult, ...]
    causes: tuple[CauseResult, ...]
    rejected: tuple[Rejected, ...]
    unexplained: Unexplained
    suggested_manoeuvres: tuple[str, ...]
    seconds: float
    model: Parameters | None = field(default=None, compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)
    identified: Mapping[str, ParameterResult] = field(default_factory=dict)
    sensor_faults: tuple[SensorFault, ...] = ()
    curves: tuple[Curve, ...] = field(default=(), compare=False)
    shapes: tuple[Shape, ...] = field(default=(), compare=False)

    def to_dict(self) -> dict[str, Any]:
        """The JSON of the documented format as plain types; numbers that are not finite become None.

        identified, sensor_faults, shapes and notes are included if they are not empty.
        """
        return {
            "verdict": str(self.verdict),
            "channels": [_plain(asdict(each)) for each in self.channels],
            "causes": [_plain(each.to_dict()) for each in self.causes],
            "rejected": [_plain(asdict(each)) for each in self.rejected],
            "unexplained": _plain(asdict(self.unexplained)),
            "suggested_manoeuvres": list(self.suggested_manoeuvres),
            "seconds": self.seconds,
            **self._extras(),
        }

    def _extras(self) -> dict[str, Any]:
        extras = {
            "identified": {name: _plain(asdict(each)) for name, each in self.identified.items()},
            "sensor_faults": [asdict(each) for each in self.sensor_faults],
            "shapes": [_plain(each.to_dict()) for each in self.shapes],
            "notes": list(self.notes),
        }
        return {key: value for key, value in extras.items() if value}

    def save_json(self, path: str | Path) -> None:
        """Write the JSON, atomically."""
        write_atomically(Path(path), json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
