"""One trial: a blind robot is diagnosed, and what was said is set against what is true.

The truth is also put into the package's own simulator (true parameters, its equations), as the best that any
diagnosis could write down: what a model gains on unseen driving is counted as a share of what that gains.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from blind.generator import Blind
from blind.hidden import Hidden
from blind.plant import BRISTLE, BRISTLE_DAMPING, COASTING_RATE, NEUTRAL
from diagnosis_cases import ROWS, TWINS, Case, hidden_causes, recording
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.experiment.advice import rank_manoeuvres
from raccoon.diagnose.experiment.manoeuvres import manoeuvre
from raccoon.diagnose.fit.noise_model import EVENT_BINS
from raccoon.diagnose.hypotheses.base_coordinates import MAX_BASE_STDS, base_coordinates
from raccoon.diagnose.hypotheses.coordinates import WIDTH_FACTOR, Coordinate, Settings, neutral_settings
from raccoon.diagnose.reports.similar_causes import causes_of_similar_size
from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import SIDES, Parameters
from raccoon.sim.effects.physical import LOOSE_STEP
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

RELEVANT = 0.15
"""Contribution, in units of the noise, from which a hidden cause is practically relevant."""
POSSIBLE = 1.02
"""Error of the nominal model, over that of the true one, from which there is something to gain."""
LEADING = {
    "factor", "voltage", "resistance", "volts_per_coulomb", "torque", "coefficient", "seconds", "angle",
    "time", "counts", "rate", "rate_per_second", "limit", "duty", "time_constant", "gain", "amplitude",
}  # fmt: skip
"""Parameters that are compared with the truth (not asymmetry and slope, which are pairs)."""
_ONE = {
    "voc": ("battery.open_circuit_voltage", "voltage"), "rint": ("battery.internal_resistance", "resistance"),
    "discharge": ("battery.discharge", "volts_per_coulomb"), "scrub": ("drive.turn_scrub", "torque"),
    "slope_x": ("drive.slope", "along_x"), "slope_y": ("drive.slope", "along_y"),
    "deadband": ("actuation.deadband", "duty"), "latency": ("actuation.latency", "seconds"),
    "gyro_bias": ("imu.gyro_bias", "rate"), "gyro_scale": ("imu.gyro_scale", "factor"),
    "gyro_drift": ("imu.gyro_drift", "rate_per_second"), "imu_latency": ("imu.latency", "seconds"),
    "heat_gain": ("motor.heating", "gain"), "heat_tau": ("motor.heating", "time_constant"),
    "current_limit": ("motor.current_limit", "limit"), "coulomb": ("friction.coulomb", "torque"),
    "viscous": ("friction.viscous", "coefficient"), "stiction": ("friction.stiction", "torque"),
    "stiction_speed": ("friction.stiction", "speed"),
    "load_friction": ("friction.load_dependent", "coefficient"),
    "dir_coulomb": ("friction.direction_dependent", "asymmetry"),
    "dir_viscous": ("friction.direction_dependent", "viscous_asymmetry"),
    "quadratic": ("friction.quadratic", "coefficient"), "backlash": ("drive.backlash", "angle"),
    "slip": ("drive.wheel_slip", "time"), "dead_zone": ("bemf.dead_zone", "counts"),
    "filter_tau": ("bemf.filter_lag", "time_constant"),
    "bemf_offset_l": ("bemf.offset", "counts"), "bemf_offset_r": ("bemf.offset", "counts"),
    "ecc_l": ("drive.wheel_eccentricity", "amplitude"), "ecc_r": ("drive.wheel_eccentricity", "amplitude"),
    "ecc_phase_l": ("drive.wheel_eccentricity", "phase"),
    "ecc_phase_r": ("drive.wheel_eccentricity", "phase"),
}  # fmt: skip
_FACTORS = {
    "resistance": "motor.armature_resistance", "ke": "motor.back_emf_constant",
    "radius": "drive.wheel_radius", "bemf_scale": "bemf.scale",
}  # fmt: skip


def true_settings(robot: Mapping[str, float]) -> Settings:
    """The blind plant's numbers as settings of the package's simulator."""
    settings = neutral_settings(RobotConfig())
    _set(settings, "drive.backlash", "coasting", None, 1.0 / COASTING_RATE)
    _set(settings, "friction.presliding", "compliance", None, 1.0 / BRISTLE)
    _set(settings, "friction.presliding", "damping", None, BRISTLE_DAMPING)
    for plant, value in robot.items():
        stem, _, side = plant.rpartition("_")
        if stem in _FACTORS:
            place = "left" if side == "l" else "right"
            settings[(_FACTORS[stem], place, "factor")] = value / NEUTRAL[plant]
        elif plant == "track":
            settings[("drive.track_width", None, "factor")] = value / NEUTRAL[plant]
        elif plant.startswith("inertia"):
            settings[("inertia", None, side)] = value / NEUTRAL[plant]
        elif plant in _ONE:
            _set(settings, *_ONE[plant], {"l": "left", "r": "right"}.get(side), value)
    return settings


def true_coordinate(coordinate: Coordinate, truth: Settings, neutral: Settings) -> float:
    """Where the truth lies along a coordinate that moves plain numbers."""
    key = coordinate.settings[0]
    usual = neutral[key] or coordinate.usual
    if coordinate.factor and usual != 0.0:
        return math.log(truth[key] / usual) / math.log(coordinate.value(1.0))
    return (truth[key] - neutral[key]) / (coordinate.from_zero or coordinate.value(1.0))


def _set(settings: Settings, id_: str, name: str, side: str | None, value: float) -> None:
    places: tuple[str | None, ...] = SIDES if ("left" in {k[1] for k in settings if k[0] == id_}) else (None,)
    for place in places:
        if side is None or place == side:
            settings[(id_, place, name)] = value


def first_part(columns: Columns, seconds: float) -> dict[str, Array]:
    """The first part of a recording."""
    kept = columns["t"] < seconds
    return {name: column[kept] for name, column in columns.items()}


def diagnosed_columns(case: Case, blind: Blind) -> Columns:
    """What the diagnosis gets of a recording; the rest is what it is judged on."""
    row = ROWS[case.row]
    return first_part(blind.columns, row.seconds) if row.tail else blind.columns


class HeldOutDrive:
    """The whole drive, judged where the diagnosis did not look."""

    def __init__(self, columns: Columns, seconds: float) -> None:
        self.log: Log = log_from_columns(columns, RobotConfig())
        self.features = Features.of(self.log)
        self.late = self.features.time >= seconds
        self._habits = Habits(Chain.firmware(), brake=False)

    def of_settings(self, settings: Sequence[Settings]) -> Array:
        """Residuals (settings, bins, channels) over the whole drive."""
        simulated = PlantRollout(self.log, RobotConfig(), self._habits, plain=True).samples(settings)
        return np.asarray(self.features.measured - self.features.simulated(simulated), float)

    def of_model(self, model: Parameters) -> Array:
        """Residual of the simulator with the model that the diagnosis wrote."""
        duty = np.clip(self.log.duty, -1.0, 1.0)
        commands = Commands.of_wheels(self.log.time, duty[:, 0], duty[:, 1], False)
        names = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
        run = rollout([model], commands, channels=names, longest_step=LOOSE_STEP)
        simulated = np.stack([run[each] for each in names], axis=1)
        return np.asarray(self.features.measured - self.features.simulated(simulated)[0], float)


def held_out_gain(blind: Blind, said: Diagnosis, seconds: float) -> dict[str, float]:
    """Error on unseen driving: nominal and diagnosed, over that of the true parameters.

    before, after: root mean square. usual_before, usual_after: the same of the median half second; a wheel
    that breaks loose a moment early or late, which chance decides, rules the root mean square and not this.
    """
    unseen = HeldOutDrive(blind.columns, seconds)
    nominal, true = unseen.of_settings([neutral_settings(RobotConfig()), true_settings(blind.robot)])
    assert said.model is not None
    found = unseen.of_model(said.model)
    floor = np.sqrt((true[unseen.late] ** 2).mean(axis=0))

    def over(residual: Array) -> float:
        return float(np.sqrt(((residual[unseen.late] / floor) ** 2).mean()))

    def usual(residual: Array) -> float:
        power = ((residual[unseen.late] / floor) ** 2).mean(axis=1)
        return float(
            np.sqrt(np.median([part.mean() for part in np.array_split(power, len(power) // EVENT_BINS)]))
        )

    return {
        "before": over(nominal),
        "after": over(found),
        "usual_before": usual(nominal) / usual(true),
        "usual_after": usual(found) / usual(true),
    }


def contributions(
    blind: Blind, seconds: float, classes: Mapping[str, Sequence[Hidden]]
) -> dict[str, dict[str, float]]:
    """What each hidden cause changes that base numbers cannot absorb: root mean square in units of the noise.

    alone: that. beside: what the other hidden causes at other sizes could not absorb either. together: the
    same as alone for all of a class at once.

    Base numbers absorb what they can within robot.toml's bounds. Simulated by the package with the true
    parameters, with and without the cause.
    """
    unseen = HeldOutDrive(first_part(blind.columns, seconds), 0.0)
    full = true_settings(blind.robot)
    base = base_coordinates(RobotConfig())
    variants = [full]
    for coordinate in base:
        moved = dict(full)
        coordinate.apply(moved, 0.5)
        variants.append(moved)
    for gone in [*([each] for each in blind.hidden), *classes.values()]:
        robot = blind.robot
        for each in gone:
            robot = _without_hidden(robot, each)
        variants.append(true_settings(robot))
    residual = unseen.of_settings(variants)
    floor = np.sqrt((residual[0] ** 2).mean(axis=0))
    rows = ((residual - residual[0]) / floor).reshape(len(variants), -1)
    columns, changes = rows[1 : len(base) + 1].T / 0.5, rows[len(base) + 1 :]
    each_alone, whole = changes[: len(blind.hidden)], changes[len(blind.hidden) :]
    none = np.zeros((columns.shape[0], 0))
    names = [each.name for each in blind.hidden]
    return {
        "alone": {
            name: _unabsorbed_rms(change, columns, none)
            for name, change in zip(names, each_alone, strict=True)
        },
        "beside": {
            name: _unabsorbed_rms(each_alone[index], columns, np.delete(each_alone, index, axis=0).T)
            for index, name in enumerate(names)
        },
        "together": {
            name: _unabsorbed_rms(change, columns, none) for name, change in zip(classes, whole, strict=True)
        },
    }


def _classes(said: Diagnosis, blind: Blind) -> dict[str, list[Hidden]]:
    """What is hidden of each class that was named, where that is more than one cause."""
    found = {}
    for cause in said.causes:
        members = [each for each in blind.hidden if each.name in (cause.name, *cause.confounded_with)]
        if len(members) > 1:
            found[cause.name] = members
    return found


def _unabsorbed_rms(change: Array, base: Array, others: Array) -> float:
    """Root mean square of what base numbers, inside their bounds, and others, at any size, do not absorb."""
    bounds = np.concatenate([np.full(base.shape[1], MAX_BASE_STDS), np.full(others.shape[1], np.inf)])
    columns = np.hstack([base, others])
    absorbed = columns @ lsq_linear(columns, change, (-bounds, bounds)).x
    return float(np.sqrt(((change - absorbed) ** 2).mean()))


def _without_hidden(robot: Mapping[str, float], hidden: Hidden) -> dict[str, float]:
    less = dict(robot)
    for name, value in hidden.plant.items():
        if NEUTRAL[name] != 0.0 and name in robot and math.isfinite(value) and name not in _SET_OUTRIGHT:
            less[name] = robot[name] * NEUTRAL[name] / value
        else:
            less[name] = robot[name] - value if name not in _SET_OUTRIGHT else NEUTRAL[name]
    return less


_SET_OUTRIGHT = {"heat_tau", "current_limit", "stiction_speed", "ecc_phase_l", "ecc_phase_r"}


def hidden_size(hidden: Hidden) -> float:
    """How many usual deviations a hidden cause is."""
    parameter = effect(hidden.id).parameters[0]
    width = WIDTH_FACTOR * parameter.prior_width
    if hidden.id == "motor.current_limit":
        return 1.0 / hidden.values["limit"]
    if hidden.id in ("friction.direction_dependent", "drive.slope"):
        return math.hypot(*hidden.values.values()) / width
    value = hidden.values[parameter.name]
    if parameter.name == "factor":
        return abs(math.log(value)) / width
    plant = next(iter(hidden.plant))
    return abs(value - NEUTRAL[plant]) / width


def diagnosis_summary(said: Diagnosis) -> dict[str, Any]:
    """What is kept of a diagnosis."""
    return {
        "verdict": str(said.verdict),
        "causes": [
            {
                "name": each.name,
                "class": list(each.confounded_with),
                "probability": each.probability,
                "rise": each.gain.heldout_rmse_before - each.gain.heldout_rmse_after,
                "error": each.gain.heldout_rmse_after,
                "change": each.change,
                "unabsorbed": each.unabsorbed,
                "parameters": {key: [p.value, p.std, p.nominal] for key, p in each.parameters.items()},
            }
            for each in said.causes
        ],
        "as_much": [each.name for each in causes_of_similar_size(said.causes)],
        "depends_on": list(said.unexplained.depends_on),
        "rejected": {each.id: each.reason for each in said.rejected},
    }


def run(case: Case, seed: int) -> dict[str, Any]:
    """Make the recording, diagnose it, and set it against the truth."""
    rng, row = case.rng(seed), ROWS[case.row]
    hidden = hidden_causes(case, rng)
    predicted = None
    if case.row == "advised":
        advice = rank_manoeuvres(
            RobotConfig(), hidden[0].name, size=hidden_size(hidden[0]), seconds=row.seconds
        )[0]
        predicted = advice.evidence
        blind = _advised(advice.manoeuvre, hidden, rng)
    else:
        blind = recording(case, hidden, rng)
    columns = diagnosed_columns(case, blind)
    begin = time.process_time()
    said = diagnose(columns, RobotConfig())
    seconds = time.process_time() - begin
    asked = [each.name for each in hidden if each.id != "unknown"]
    if case.row == "unmeasured":  # every number is off, whichever names it is given
        asked = list(dict.fromkeys([*asked, *(each.name for each in said.causes)]))
    result: dict[str, Any] = {
        "key": case.key, "row": case.row, "cause": case.cause, "seed": blind.seed,
        "hidden": {each.name: dict(each.values) for each in blind.hidden},
        "true": _true(asked, blind.robot), "nominal": _true(asked, NEUTRAL),
        "seconds": seconds, "predicted": predicted, **diagnosis_summary(said),
    }  # fmt: skip
    if case.row == "unknown":
        result |= {"patched": blind.patched, "sizes": [each.size.value for each in said.shapes]}
    if row.tail:
        result["gain"] = held_out_gain(blind, said, row.seconds)
    if hidden and case.row != "unknown":
        result |= contributions(blind, row.seconds, _classes(said, blind))
    return result


def _advised(name: str, hidden: list[Hidden], rng: np.random.Generator) -> Blind:
    from blind.generator import make

    return make(int(rng.integers(2**31)), hidden, drive=manoeuvre(name))


def _true(names: Sequence[str], robot: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """The values of these causes' parameters in a robot, with its own deviation in them; of one that both
    wheels share their mean."""
    settings = true_settings(robot)
    found = {}
    for name in names:
        id_, _, where = name.partition("@")
        places = [key[1] for key in settings if key[0] == id_ and where in ("", key[1])]
        parameters = [each.name for each in effect(id_).parameters if each.name in LEADING]
        values = {each: float(np.mean([settings[(id_, at, each)] for at in places])) for each in parameters}
        if id_ == "drive.inertia":
            kinds = [settings[("inertia", None, kind)] for kind in ("straight", "turn")]
            values = {"factor": float(np.mean(kinds))}
        found[name] = {parameter: value for parameter, value in values.items() if math.isfinite(value)}
    return found


def expected_class(cause: str) -> frozenset[str]:
    """The class in which a structural twin must be reported."""
    return TWINS[cause][1]
