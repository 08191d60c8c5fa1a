"""Brushed DC motor at the wheel shaft, winding inductance left out.

    U = R I + K w            (the paper's section II; K in V s/rad)
    K I = J w' + T_c sgn w + B w

Leaving the inductance out costs a delay of L / R: below 1 ms for motors of this size, against a mechanical
time constant of 20-40 ms.
"""

from __future__ import annotations

import math


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


def speed_after(
    seconds: float, speed: float, torque: float, coulomb: float, damping: float, inertia: float
) -> float:
    """rad/s of a shaft `seconds` later: J w' = torque - T_c sgn w - D w, solved exactly.

    Dry friction opposes the motion, whichever way the torque is, and holds a shaft at rest that is pushed by
    no more than T_c. torque: N m at standstill. damping: N m s/rad, all that falls with the speed.
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
    # It comes to rest on the way, and may begin anew the other way.
    lost = -damping * speed / net
    needed = -speed * inertia / net * (math.log1p(lost) / lost if lost > 0.0 else 1.0)
    return speed_after(max(0.0, seconds - needed), 0.0, torque, coulomb, damping, inertia)
