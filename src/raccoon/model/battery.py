"""Battery: a voltage behind a resistance.

Sources: the paper's section II; for motors driven with a duty, currents at the battery are duty times the
motor's (the driver conserves power).
"""

from __future__ import annotations


def terminal_voltage(open_circuit_voltage: float, internal_resistance: float, current: float) -> float:
    """V at the terminals while `current` A are drawn (negative: charged): U = U_oc - I R_i."""
    return open_circuit_voltage - internal_resistance * current


def battery_current(duties: tuple[float, ...], motor_currents: tuple[float, ...]) -> float:
    """A drawn from the battery: sum of duty times motor current; negative while motors feed back."""
    return sum(duty * current for duty, current in zip(duties, motor_currents, strict=True))


def open_circuit_voltage(terminal: float, internal_resistance: float, current: float) -> float:
    """V without load, from the voltage seen under load."""
    return terminal + internal_resistance * current
