"""Brushed DC motor at the wheel shaft, without winding inductance.

    U = R I + K w            (the paper's section II; K in V s/rad)
    K I = J w' + T_c sgn w + B w

Without the inductance a delay of L / R is missing: below 1 ms for motors of this size, against a mechanical
time constant of 20-40 ms.
"""

from __future__ import annotations

import math


def steady_speed(
    voltage: float, resistance: float, back_emf_constant: float, coulomb: float = 0.0, viscous: float = 0.0
) -> float:
    """Speed at which torque and friction balance, rad/s; 0 if the motor cannot break loose.

    K (U - K w) / R = T_c + B w, solved for w > 0 and mirrored for U < 0.
    """
    push = back_emf_constant * abs(voltage) / resistance - coulomb
    if push <= 0.0:
        return 0.0
    speed = push / (back_emf_constant * back_emf_constant / resistance + viscous)
    return math.copysign(speed, voltage)


def speed_after(
    seconds: float, speed: float, torque: float, coulomb: float, damping: float, inertia: float
) -> float:
    """Speed of a shaft `seconds` later, rad/s: J w' = torque - T_c sgn w - D w, solved exactly.

    Dry friction opposes the motion, whatever the sign of the torque, and holds a shaft at rest if |torque| is
    at most T_c. torque: N m at standstill. coulomb: T_c, N m. damping: D, N m s/rad, everything that
    decreases with the speed. inertia: J, kg m2.
    """
    way = speed if speed != 0.0 else torque
    net = torque - math.copysign(coulomb, way)
    if speed == 0.0 and net * way <= 0.0:
        return 0.0
    fade = damping * seconds / inertia
    mean = -math.expm1(-fade) / fade if fade > 0.0 else 1.0
    after = speed + (net - damping * speed) * seconds / inertia * mean
    if net * way >= 0.0 or after * speed > 0.0:
        return after
    # The shaft comes to rest meanwhile, and may start in the other direction.
    lost = -damping * speed / net
    needed = -speed * inertia / net * (math.log1p(lost) / lost if lost > 0.0 else 1.0)
    return speed_after(max(0.0, seconds - needed), 0.0, torque, coulomb, damping, inertia)
