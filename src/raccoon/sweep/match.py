"""One simulated match of a program: everything about it follows from one seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError, HardwareError, RaccoonError
from raccoon.core.files import copy_kept_files
from raccoon.core.port import Port
from raccoon.robot.opening import no_robot_opened, open_robot
from raccoon.robot.robot import Robot
from raccoon.sim.effects.chain import FIRMWARE_IMU_HZ, Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.world.collision import check_standing
from raccoon.sim.world.table import World
from raccoon.sweep.factors import AMBIENT_LIGHT, Factor, nominal_values, refuse_ineffective, robot_with
from raccoon.sweep.faults import FAULT_KINDS, FaultPlan, FaultyPort
from raccoon.sweep.isolation import isolated_process_state
from raccoon.sweep.limits import DEFAULT_MATCH_S, DEFAULT_WITHIN, DEFAULT_WITHIN_DEGREES
from raccoon.sweep.program import Mission, Program
from raccoon.sweep.results import Row
from raccoon.sweep.watched_port import MatchOver, WatchedPort, wall_limit
from raccoon.trace.record import existing_recording

OK, FAILED, CRASHED = "ok", "failed", "crashed"
SETTLING_S = 0.5
"""s after the program's end until the robot stands."""
LATEST_FAULT_S = 10.0
"""s from the start until a fault has begun, if the match has one."""
MAX_REASON = 200


@dataclass(frozen=True, slots=True)
class Match:
    """What all matches of a sweep share.

    chain: how the controller samples and filters, and imu_rate_hz how often there is a new IMU reading: by
    default as in the RaccoonOS firmware. world: the table; None is the Botball-size one. start: pose on it
    (m, m, rad). within, within_angle: m and rad by which a match may end off the nominal robot's end.
    seconds: of a match. real_seconds: that its computation may take. end: pose (m, m, rad) at which the
    nominal robot ends, None if the end does not count. model: the robot that plays, as a diagnosis found it,
    while the program uses `robot`; None for a robot as `robot` says.
    """

    program: Program
    robot: RobotConfig
    factors: tuple[Factor, ...]
    chain: Chain = field(default_factory=Chain.firmware)
    imu_rate_hz: float = FIRMWARE_IMU_HZ
    world: World | None = None
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    within: float = DEFAULT_WITHIN
    within_angle: float = math.radians(DEFAULT_WITHIN_DEGREES)
    seconds: float = DEFAULT_MATCH_S
    real_seconds: float = 300.0
    end: tuple[float, float, float] | None = None
    model: Parameters | None = None

    def __post_init__(self) -> None:
        for name in ("within", "within_angle", "seconds", "real_seconds"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} is {getattr(self, name)}: it must be above 0")
        refuse_ineffective(self.robot, self.factors)
        self.simulated_robot(self.values(0))  # refuses places that the robot does not have
        check_standing(self.start, self.table, self.robot.body)

    def simulated_robot(self, values: dict[str, float]) -> Parameters:
        """The robot that plays, with these values of the factors. Raises ConfigError for a place that it does
        not have."""
        return robot_with(self.model or Parameters.from_robot(self.robot), self.factors, values)

    @property
    def table(self) -> World:
        """The table."""
        return World.default() if self.world is None else self.world

    def ending_at(self, end: Sequence[float] | None) -> Match:
        """The same match, with a goal or without."""
        return replace(self, end=None if end is None else (end[0], end[1], end[2]))

    def values(self, seed: int) -> dict[str, float]:
        """The drawn value of every factor. It does not depend on the other factors, so that sweeps of one
        seed can be compared match by match."""
        import numpy as np

        def random(name: str) -> np.random.Generator:
            return np.random.default_rng((seed, *name.encode()))

        return {factor.name: factor.draw(random(factor.name)) for factor in self.factors}

    def fault_plan(self, values: dict[str, float], seed: int) -> FaultPlan:
        """The faults among the values, and when they begin: within the first LATEST_FAULT_S seconds."""
        import numpy as np

        kinds = tuple(name for name in FAULT_KINDS if values.get(name))
        return FaultPlan(kinds, float(np.random.default_rng((seed, 1)).uniform(0.0, LATEST_FAULT_S)))


def seed_of(sweep_seed: int, run: int) -> int:
    """Seed of one match: 63 bits that differ from match to match and from sweep to sweep.

    Raises ConfigError for a seed below 0.
    """
    import numpy as np

    if sweep_seed < 0:
        raise ConfigError(f"seed is {sweep_seed}: allowed are whole numbers from 0")
    words = np.random.SeedSequence(sweep_seed, spawn_key=(run,)).generate_state(2, np.uint32)
    return (int(words[0]) << 32 | int(words[1])) >> 1


def columns(match: Match) -> tuple[str, ...]:
    """The names of a row's values, in order."""
    fixed = ("run", "seed", "status", "reason", "seconds", "x", "y", "heading")
    return (*fixed, "position_error", "heading_error", *(factor.name for factor in match.factors))


def nominal_end(match: Match) -> tuple[float, float, float]:
    """The pose at which the program ends on the robot that robot.toml describes. Raises ConfigError if it
    fails even there, since a sweep would be meaningless."""
    values = nominal_values(match.robot, match.factors)
    factors = tuple(each for each in match.factors if each.name in values)
    row = _play(replace(match, factors=factors, end=None, model=None), values, seed=0, record=None)
    if row["status"] != OK:
        raise ConfigError(f"{match.program.name} fails on the nominal robot already: {row['reason']}")
    return row["x"], row["y"], row["heading"]


def play(match: Match, run: int, seed: int, record: str | Path | None = None) -> Row:
    """Play a match. record: where to write its trace, None for nowhere. No error of the program is passed on.
    Raises FileExistsError if the recording exists."""
    there = None if record is None else existing_recording(record)
    if there is not None:
        raise FileExistsError(f"{there} exists: choose another name")
    values = match.values(seed)
    return {"run": run, "seed": seed, **_play(match, values, seed, record), **values}


def crashed_row(match: Match, run: int, seed: int) -> Row:
    """The row of a match that crashed its process."""
    nothing = dict.fromkeys(("seconds", "x", "y", "heading", "position_error", "heading_error"), math.nan)
    reason = {"status": CRASHED, "reason": "the process ended"}
    return {"run": run, "seed": seed, **reason, **nothing, **match.values(seed)}


def _play(match: Match, values: dict[str, float], seed: int, record: str | Path | None) -> Row:
    port = WatchedPort(_simulated_port(match, values, seed), match.seconds)
    reason = ""
    try:
        with (
            wall_limit(match.real_seconds),
            isolated_process_state(seed),
            copy_kept_files(),
            no_robot_opened(),
        ):
            mission = match.program.mission()
            reason = _drive(match, mission, port, record, seed)
    except MatchOver as over:
        reason = str(over)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # asyncio's CancelledError and SystemExit are no Exception
        # What the library raises on purpose says what to do; a mistake of the program says hardly where.
        line = None if isinstance(error, RaccoonError) else match.program.line_of(error)
        reason = _failure_text(error) + ("" if line is None else f" (line {line})")
    reason = reason if len(reason) <= MAX_REASON else f"{reason[: MAX_REASON - 3]}..."
    return _row(match, port, reason)


def _failure_text(error: BaseException) -> str:
    """Kind and text of an error. A program's own error may fail to give its text, and the name of a file may
    not be text, which a table cannot hold."""
    kind = type(error).__name__
    try:
        return f"{kind}: {error}".rstrip().encode("utf-8", "backslashreplace").decode()
    except Exception as failed:
        return f"{kind}: its own text ended in {type(failed).__name__}"


def _simulated_port(match: Match, values: dict[str, float], seed: int) -> Port:
    from raccoon.sim.port import SimPort
    from raccoon.sim.world.table import Box, Light

    world = match.table
    if AMBIENT_LIGHT in values:
        everywhere = Box((-math.inf, -math.inf), (math.inf, math.inf))
        world = replace(world, lights=(*world.lights, Light(everywhere, values[AMBIENT_LIGHT])))
    port = SimPort(
        match.simulated_robot(values).with_chain(match.chain),
        world,
        robot=match.robot,
        seed=seed_of(seed, 0),  # of numbers of its own: those of `seed` made the values
        rate_hz=match.robot.controller.rate_hz,
        start=match.start,
        imu_rate_hz=match.imu_rate_hz,
    )
    broken = match.fault_plan(values, seed)
    return FaultyPort(port, broken) if broken.kinds else port


def _drive(match: Match, mission: Mission, port: WatchedPort, record: str | Path | None, seed: int) -> str:
    """Run the mission and let the robot come to rest; returns why it failed, "" if it did not."""
    from raccoon.robot.actions.functions import NOTHING_RUN_HINT, perform

    with open_robot(match.robot, port=port, record=record, seed=seed) as robot:
        try:
            done = perform(robot, mission)
            ran = robot.ticks > 0
        finally:
            port.limit = math.inf
            robot.stop()
            _come_to_rest(robot)
    if done is False:
        return "mission returned False"
    return "" if ran else NOTHING_RUN_HINT


def _come_to_rest(robot: Robot) -> None:
    """Let SETTLING_S pass with the motors off, at the port, since a robot runs nothing after its match."""
    with suppress(HardwareError):
        end = robot.port.read().time + SETTLING_S
        while robot.port.read().time < end:
            robot.port.write(robot.outputs)


def _row(match: Match, port: WatchedPort, reason: str) -> Row:
    x, y, heading = (math.nan,) * 3
    if port.truth is not None:
        x, y, heading = port.truth.x, port.truth.y, port.truth.heading
    position_error, heading_error = math.nan, math.nan
    if match.end is not None and port.truth is not None:
        position_error = math.hypot(x - match.end[0], y - match.end[1])
        heading_error = abs(math.remainder(heading - match.end[2], math.tau))
        if not reason and not position_error <= match.within:
            reason = f"ended more than {match.within:g} m off"
        elif not reason and not heading_error <= match.within_angle:
            reason = f"ended more than {math.degrees(match.within_angle):g} deg off in heading"
    return {
        "status": FAILED if reason else OK,
        "reason": reason,
        "seconds": port.time,
        "x": x,
        "y": y,
        "heading": heading,
        "position_error": position_error,
        "heading_error": heading_error,
    }
