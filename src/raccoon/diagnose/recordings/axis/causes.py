"""Candidate causes for one motor or axis: the catalogue's effects that its channels can show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from raccoon.diagnose.recordings.axis.fit import FreeParameter
from raccoon.diagnose.recordings.axis.log import AxisLog
from raccoon.diagnose.recordings.axis.rough_estimate import RoughAxis

MAX_ASYMMETRY = 0.95
"""Largest relative asymmetry of friction between directions."""
MAX_LATENCY_S = 0.25
"""Longest latency that is tried, s."""
LATENCY_SCAN = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
DEAD_BAND_SCAN = (0.4, 0.6, 0.8, 1.0, 1.25, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0)
"""Values of u that are scanned before a fit, for a latency and for a dead band."""


@dataclass(frozen=True, slots=True)
class AxisCause:
    """A candidate effect of the catalogue. parameters: of the axis model, that it frees. contract_names:
    their names in the contract. starts: u at which a fit begins. scan: values of u of its single parameter
    that are tried first, for effects from which a distant fit does not converge. An effect may have two
    candidates, with two rules; at most one of them is named."""

    id: str
    parameters: tuple[FreeParameter, ...]
    contract_names: tuple[str, ...]
    starts: tuple[float, ...]
    scan: tuple[float, ...] = ()


def axis_causes(log: AxisLog, rough: RoughAxis) -> tuple[AxisCause, ...]:
    """Candidate causes in the order in which they are preferred at equal evidence.

    If a force drives the axis, dry and viscous friction and a constant force are part of the base model,
    since any mechanism has them. A motor's base model is the textbook's, U = R I + L dI/dt + K_E w with an
    inertia. There, viscous friction is only identifiable with a measured current (else it is part of K_E). A
    dead band of the voltage follows one of two rules: that of the simulated robot (nothing up to it, then
    linear up to the full effort at full command), or a threshold (smaller commands do nothing, larger ones
    act in full).
    """
    is_mechanism = log.effort_unit != "V"
    causes = (
        []
        if is_mechanism
        else [_non_negative_cause("friction.coulomb", "torque", "coulomb", 0.2 * rough.force, 0.3)]
    )
    if log.is_electrical:
        width = 0.2 * rough.force / rough.speed
        causes.append(_non_negative_cause("friction.viscous", "coefficient", "viscous", width, 0.2))
    causes += [
        _non_negative_cause(
            "actuation.latency", "seconds", "latency", 0.02, 0.2, MAX_LATENCY_S, LATENCY_SCAN
        ),
        _direction_cause(log, is_mechanism),
        _stiction_cause(rough),
        _non_negative_cause("friction.load_dependent", "coefficient", "load", 0.2, 0.1, 0.9),
        _non_negative_cause(
            "friction.quadratic", "coefficient", "quadratic", 0.2 * rough.force / rough.speed**2, 0.1
        ),
    ]
    if not is_mechanism:
        width, max_dead_band = 0.05 * rough.effort, 0.5 * rough.effort
        causes += [
            _non_negative_cause(
                "actuation.deadband", "duty", number, width, 0.3, max_dead_band, DEAD_BAND_SCAN
            )
            for number in ("deadband", "dead_below")
        ]
        causes.append(AxisCause("drive.slope", (constant_force(rough),), ("along_x",), (0.1,)))
    return tuple(causes)


def _non_negative_cause(
    id: str,  # noqa: A002
    contract_name: str,
    model_name: str,
    width: float,
    start: float,
    high: float = math.inf,
    scan: tuple[float, ...] = (),
) -> AxisCause:
    """A cause with one parameter that is not negative."""
    free = FreeParameter(model_name, 0.0, width, low=0.0, high=high, prior=True)
    return AxisCause(id, (free,), (contract_name,), (start,), scan)


def constant_force(rough: RoughAxis) -> FreeParameter:
    """The parameter of a constant force in one direction."""
    return FreeParameter("offset", 0.0, 0.1 * rough.force, prior=True)


def dry_friction_asymmetry() -> FreeParameter:
    """The parameter of dry friction's asymmetry: its excess forwards over its mean, relative to the mean."""
    return FreeParameter("asymmetry", 0.0, 0.4, low=-MAX_ASYMMETRY, high=MAX_ASYMMETRY, prior=True)


def _direction_cause(log: AxisLog, is_mechanism: bool) -> AxisCause:
    """Direction-dependent friction. While the axis moves, asymmetric dry friction acts as a constant force:
    if the base model has such a force, only the viscous part is identifiable."""
    viscous = FreeParameter("viscous_asymmetry", 0.0, 0.4, low=-MAX_ASYMMETRY, high=MAX_ASYMMETRY, prior=True)
    dry = dry_friction_asymmetry()
    id_ = "friction.direction_dependent"
    if is_mechanism:
        return AxisCause(id_, (viscous,), ("viscous_asymmetry",), (0.1,))
    if log.is_electrical:
        return AxisCause(id_, (dry, viscous), ("asymmetry", "viscous_asymmetry"), (0.1, 0.1))
    return AxisCause(id_, (dry,), ("asymmetry",), (0.1,))


def _stiction_cause(rough: RoughAxis) -> AxisCause:
    torque = FreeParameter("stiction", 0.0, 0.1 * rough.force, low=0.0, prior=True)
    max_speed = 0.3 * rough.speed
    speed = FreeParameter(
        "stiction_speed", 0.05 * rough.speed, 0.7, positive=True, high=max_speed, prior=True
    )
    return AxisCause("friction.stiction", (torque, speed), ("torque", "speed"), (0.3, 0.0))


def unit_of(name: str, log: AxisLog) -> str:
    """Unit of a parameter of the model for this axis."""
    torque, speed = log.torque_unit, log.speed_unit
    per_speed = speed.replace("/s", "")
    units: Mapping[str, str] = {
        "resistance": "ohm",
        "inductance": "H" if log.is_electrical else "s",
        "back_emf": f"V s/{per_speed}",
        "inertia": "kg" if torque == "N" else "kg m2" if torque == "N m" else f"V s2/{per_speed}",
        "viscous": f"{torque} s/{per_speed}",
        "coulomb": torque,
        "stiction": torque,
        "offset": torque,
        "quadratic": f"{torque} s2/{per_speed}2",
        "stiction_speed": speed,
        "latency": "s",
        "deadband": "V",
        "dead_below": "V",
    }
    return units.get(name, "")
