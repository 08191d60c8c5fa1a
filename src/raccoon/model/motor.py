"""Brushed DC motor at the wheel shaft, winding inductance left out.

    U = R I + K w            (the paper's section II; K in V s/rad)
    K I = J w' + T_c sgn w + B w

Leaving the inductance out costs a delay of L / R: below 1 ms for motors of this size, against a mechanical
time constant of 20-40 ms.
"""

from __future__ import annotations

import math


def current(voltage: float, speed: float, resistance: float, back_emf_constant: float) -> float:
    """A through a motor that turns at `speed` rad/s on `voltage` V."""
    return (voltage - back_emf_constant * speed) / resistance


def steady_speed(
    voltage: float, resistance: float, back_emf_constant: float, coulomb: float = 0.0, viscous: float = 0.0
) -> float:
    """rad/s at which torque and friction balance; 0 where the motor cannot break loose.

    K (U - K w) / R = T_c + B w, solved for w > 0 and mirrored for U < 0.
    """
    push = back_emf_constant * abs(voltage) / resistance - coulomb
    if push <= 0.0:
        return 0.0
    speed = push / (back_emf_constant * back_emf_constant / resistance + viscous)
    return math.copysign(speed, voltage)


def time_constant(inertia: float, resistance: float, back_emf_constant: float, viscous: float = 0.0) -> float:
    """s in which the speed covers 63 % of a step: J / (K^2 / R + B)."""
    return inertia / (back_emf_constant * back_emf_constant / resistance + viscous)
