"""Write `ekf/generated.py`: the drive filter's algebra, unrolled (run once at development time; needs SymPy).

    python -m raccoon.estimate.ekf.generate

The model is written below as one would on paper; SymPy differentiates it, and the products of sparse,
symmetric matrices are written out term by term. `tests/unit/estimate/ekf/test_ekf.py` holds the result
to filterpy and the checked-in file to this generator.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import sympy as sp

from raccoon.estimate.ekf.state import MIN_TURN, MIN_VELOCITY, SIZE, State

NAMES = [state.name.lower() for state in State]
SYMBOLS = {state: sp.Symbol(state.name.lower()) for state in State}
DT, RADIUS, HALF_TRACK = sp.symbols("dt radius half_track")
TURN_ACCELERATION = sp.Symbol("turn_acceleration")
WHEELS_TURN = SYMBOLS[State.TURN_RATE] + SYMBOLS[State.GYRO_DELAY] * TURN_ACCELERATION
PROCESS_NOISE = {
    State.VELOCITY: "q_velocity",
    State.TURN_RATE: "q_turn_rate",
    State.GYRO_BIAS: "q_gyro_bias",
    State.LEFT_OFFSET: "q_offset",
    State.RIGHT_OFFSET: "q_offset",
    State.WAY: "q_scale",
    State.BALANCE: "q_scale",
    State.WHEEL_TURN: "q_scale",
}
UPDATE_PARAMETERS = (
    "z_left: float, r_left: float, z_right: float, r_right: float, z_gyro: float | None, r_gyro: float, "
    "turn_acceleration: float, r_differential: float, radius: float, half_track: float"
)
STANDSTILL_SENSORS = ("velocity", "turn_rate")
VARIANCES = {
    "left": "r_left + r_differential",
    "right": "r_right + r_differential + shared * r_differential",
    "gyro": "r_gyro",
    "velocity": "r_velocity",
    "turn_rate": "r_turn_rate",
}
"""Variance of each scalar measurement. A differential error adds to one wheel's reading what it subtracts
from the other's: their covariance is -r_differential. The part of it that the left wheel's update explains,
shared = -r_differential / (r_left + r_differential), is subtracted from the right wheel's."""
TELLING_MOTION = {
    State.BALANCE: {"velocity": "telling_velocity"},
    State.WHEEL_TURN: {"wheels_turn": "telling_turn"},
    State.GYRO_SCALE: {"turn_rate": "telling_rate"},
}
"""Motion in the Jacobian of a scale; 0 if it is too slow to show the scale."""
TARGET = Path(__file__).with_name("generated.py")


def motion() -> dict[State, Any]:
    """Pose after dt at constant velocity and turn rate: the chord of the arc, at its middle heading."""
    middle = SYMBOLS[State.HEADING] + SYMBOLS[State.TURN_RATE] * DT / 2
    return {
        State.X: SYMBOLS[State.X] + SYMBOLS[State.WAY] * SYMBOLS[State.VELOCITY] * DT * sp.cos(middle),
        State.Y: SYMBOLS[State.Y] + SYMBOLS[State.WAY] * SYMBOLS[State.VELOCITY] * DT * sp.sin(middle),
        State.HEADING: SYMBOLS[State.HEADING] + SYMBOLS[State.TURN_RATE] * DT,
    }


def measurements() -> dict[str, Any]:
    """Reading of each sensor: scale times motion, plus its reading at rest."""
    s = SYMBOLS
    side = HALF_TRACK * s[State.WHEEL_TURN] * WHEELS_TURN
    return {
        "left": (1 - s[State.BALANCE]) * (s[State.VELOCITY] - side) / RADIUS + s[State.LEFT_OFFSET],
        "right": (1 + s[State.BALANCE]) * (s[State.VELOCITY] + side) / RADIUS + s[State.RIGHT_OFFSET],
        "gyro": s[State.GYRO_SCALE] * s[State.TURN_RATE] + s[State.GYRO_BIAS],
        "velocity": s[State.VELOCITY],
        "turn_rate": s[State.TURN_RATE],
    }


def cov(i: int, j: int) -> str:
    """Name of an entry of the symmetric covariance."""
    return f"p{min(i, j)}_{max(i, j)}"


def code(expression: Any) -> str:
    """One expression as Python."""
    return str(sp.pycode(expression)).replace("math.", "")


def term(factor: Any, name: str) -> str:
    """factor * name, without a factor of 1."""
    return name if factor == "1" else f"{factor} * {name}"


def predict_lines() -> list[str]:
    """State and covariance after dt: P = F (P + Q) F'."""
    lines = [f"{cov(state, state)} += {name}" for state, name in PROCESS_NOISE.items()]
    lines.append(f"{cov(State.WAY, State.WHEEL_TURN)} -= q_scale")
    lines += [
        "middle = heading + 0.5 * dt * turn_rate",
        "along_x = dt * cos(middle)",
        "along_y = dt * sin(middle)",
    ]
    moved = motion()
    jacobian: dict[int, dict[int, str]] = {}
    middle = SYMBOLS[State.HEADING] + SYMBOLS[State.TURN_RATE] * DT / 2
    short = {DT * sp.cos(middle): sp.Symbol("along_x"), DT * sp.sin(middle): sp.Symbol("along_y")}
    for row, expression in moved.items():
        jacobian[row] = {}
        for column, symbol in SYMBOLS.items():
            slope = sp.diff(expression, symbol)
            if row != column and slope != 0:
                name = f"f{int(row)}_{int(column)}"
                lines.append(f"{name} = {code(slope.subs(short))}")
                jacobian[row][column] = name
    rows = list(moved)
    for row in rows:
        for j in (each for each in range(SIZE) if each not in rows or each >= row):
            parts = [cov(row, j)] + [term(f, cov(k, j)) for k, f in jacobian[row].items()]
            lines.append(f"b{int(row)}_{j} = {' + '.join(parts)}")
    for row in rows:
        for j in range(SIZE):
            if j not in rows:
                lines.append(f"{cov(row, j)} = b{int(row)}_{j}")
    for place, row in enumerate(rows):
        for column in rows[place:]:
            parts = [f"b{int(row)}_{int(column)}"]
            parts += [term(f, f"b{int(row)}_{int(k)}") for k, f in jacobian[column].items()]
            lines.append(f"{cov(row, column)} = {' + '.join(parts)}")
    lines += ["x += way * velocity * along_x", "y += way * velocity * along_y", "heading += dt * turn_rate"]
    return lines


def wheels_lines() -> list[str]:
    """Both wheels' innovations and Jacobians, at the predicted state, and their updates."""
    return [
        "inverse_radius = 1.0 / radius",
        "shared = -r_differential / (r_left + r_differential)",
        f"wheels_turn = {code(WHEELS_TURN)}",
        f"telling_velocity = velocity if abs(velocity) > {MIN_VELOCITY} else 0.0",
        f"telling_turn = wheels_turn if abs(turn_rate) > {MIN_TURN} else 0.0",
        *linearise_lines("left"),
        *linearise_lines("right"),
        "y_right -= shared * y_left",
        *update_lines("left", True),
        *update_lines("right", False),
        "innovations: Flat = (y_left, s_left, y_right, s_right)",
    ]


def gyro_lines() -> list[str]:
    """The gyro's update, if it has a reading; the Jacobian is still at the predicted state."""
    lines = [
        f"telling_rate = turn_rate if abs(turn_rate) > {MIN_TURN} else 0.0",
        *linearise_lines("gyro"),
        *update_lines("gyro", False),
        "innovations = (*innovations, y_gyro, s_gyro)",
    ]
    return ["if z_gyro is not None:", *(f"    {line}" for line in lines)]


def linearise_lines(sensor: str) -> list[str]:
    """Innovation and Jacobian of a measurement."""
    lines = [f"y_{sensor} = z_{sensor} - ({code(short(reading(sensor)))})"]
    for symbol, name in slopes(sensor).items():
        if name != "1":
            lines.append(f"{name} = {slope_code(sensor, symbol)}")
    return lines


def reading(sensor: str) -> Any:
    """Reading of a sensor, with the division by the radius done once."""
    return measurements()[sensor].subs(1 / RADIUS, sp.Symbol("inverse_radius"))


def short(expression: Any) -> Any:
    """The expression with the turn rate of the wheels' time as one name."""
    return expression.subs(WHEELS_TURN, sp.Symbol("wheels_turn"))


def slope_code(sensor: str, symbol: State) -> str:
    """Derivative of a measurement as Python; the right wheel's without the part it shares with the left
    one."""
    slope = short(sp.diff(reading(sensor), SYMBOLS[symbol]))
    slope = slope.subs(TELLING_MOTION.get(symbol, {}))
    if sensor != "right":
        return code(slope)
    taken = f"shared * {slopes('left')[symbol]}" if slopes("left")[symbol] != "1" else "shared"
    return f"{code(slope)} - {taken}" if slope != 0 else f"-{taken}"


def slopes(sensor: str) -> dict[State, str]:
    """The states that a sensor depends on, with the names of the derivatives."""
    found = {}
    for state, symbol in SYMBOLS.items():
        slope = sp.diff(measurements()[sensor], symbol)
        if slope != 0:
            found[state] = "1" if slope == 1 else f"h_{sensor}_{int(state)}"
    if sensor == "right":
        return {
            state: found.get(state, f"h_right_{int(state)}")
            for state in (*slopes("left"), State.RIGHT_OFFSET)
        }
    return found


def update_lines(sensor: str, first: bool) -> list[str]:
    """One scalar update. The innovation includes the changes by earlier updates of this step.

    P - K g' with g = P H' = K S is the product of Joseph's form (I - K H) P (I - K H)' + K R K' for this K;
    on the upper triangle it cannot lose symmetry.
    """
    h = slopes(sensor)
    lines = []
    for i in range(SIZE):
        lines.append(f"g{i} = {' + '.join(term(f, cov(i, k)) for k, f in h.items())}")
    lines.append(
        f"s_{sensor} = {' + '.join(term(f, f'g{int(k)}') for k, f in h.items())} + {VARIANCES[sensor]}"
    )
    if not first:
        lines.append(f"y_{sensor} -= {' + '.join(term(f, f'd{int(k)}') for k, f in h.items())}")
    lines.append(f"w = 1.0 / s_{sensor}")
    lines += [f"k{i} = g{i} * w" for i in range(SIZE)]
    if first:
        lines += [f"d{i} = k{i} * y_{sensor}" for i in range(SIZE)]
    else:
        lines += [f"d{i} += k{i} * y_{sensor}" for i in range(SIZE)]
    lines += [f"{cov(i, j)} -= k{i} * g{j}" for i in range(SIZE) for j in range(i, SIZE)]
    return lines


def function(name: str, parameters: str, gives: str, doc: str, body: Sequence[str], returned: str) -> str:
    """Source of one function of the flat state."""
    flat = ", ".join(NAMES + [cov(i, j) for i in range(SIZE) for j in range(i, SIZE)])
    head = [f"def {name}(", *fill(f"state: Flat, {parameters}"), f") -> {gives}:", f'    """{doc}"""']
    body = [f"({flat},) = state", *body, f"return ({flat}){returned}"]
    return "\n".join(head + [wrapped for line in body for wrapped in fill(line)])


def moved_lines() -> list[str]:
    """The state, moved by all updates together."""
    return [f"{each} += d{i}" for i, each in enumerate(NAMES)]


def fill(line: str) -> list[str]:
    """One statement, broken into lines if it is too long."""
    name, equals, value = line.partition("= ")
    if equals and len(line) > 100:
        line = f"{name}= ({value})"
    return textwrap.wrap(line, 108, initial_indent="    ", subsequent_indent="        ")


HEADER = '''"""The drive filter's predict and update, unrolled. Written by `ekf/generate.py`: edit the
model there.

Each function takes and gives the flat state: the named states of `state.State`, then the upper
triangle of their covariance by rows. `update` also gives (innovation, variance of it) of each measurement.
"""

from __future__ import annotations

from math import cos, sin

# fmt: off
Flat = tuple[float, ...]
'''


def source() -> str:
    """The source of the whole generated module."""
    noise = ", ".join(f"{q}: float" for q in dict.fromkeys(PROCESS_NOISE.values()))
    at_rest = [f"y_{sensor} = 0.0 - {sensor}" for sensor in STANDSTILL_SENSORS]
    functions = [
        function("predict", f"dt: float, {noise}", "Flat", "Move on by dt.", predict_lines(), ""),
        function(
            "update",
            UPDATE_PARAMETERS,
            "tuple[Flat, Flat]",
            "Both wheels read, and the gyro where it is not None.",
            [*wheels_lines(), *gyro_lines(), *moved_lines()],
            ", innovations",
        ),
        function(
            "update_still",
            ", ".join(f"r_{sensor}: float" for sensor in STANDSTILL_SENSORS),
            "Flat",
            "The robot stands still.",
            [*at_rest, *update_lines("velocity", True), *update_lines("turn_rate", False), *moved_lines()],
            "",
        ),
    ]
    return HEADER + "\n\n" + "\n\n\n".join(functions) + "\n"


if __name__ == "__main__":
    TARGET.write_text(source(), encoding="utf-8")
