"""The simulator driven by a recording's commands, for many variants of the robot at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log, column_names
from raccoon.diagnose.drives.ramp import Ramp
from raccoon.diagnose.hypotheses.base_coordinates import WheelSliding
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.own import OwnEffect, Simulated
from raccoon.diagnose.rollout.censored_readings import MIN_ZONE_COUNTS, censor_readings, find_flickers
from raccoon.diagnose.rollout.encoder_window import WINDOW, average_over_window
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.sample_ages import SAMPLE_AGE, samples_at_age
from raccoon.diagnose.rollout.simulated_robot import Variant, gyro_numbers, with_inertia
from raccoon.sim.effects.chain import SHORTEST_CYCLE, Chain
from raccoon.sim.effects.nominal import check_nominal, check_section
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import (
    LOOSE_STEP,
    SHORTEST,
    plant_numbers,
    safe_step,
    sample_slots,
    time_constants,
)
from raccoon.sim.plant.quantities import Plant
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import Lanes, rollout
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Possible = NDArray[np.bool_]


VARIANTS_AT_ONCE = 64
"""Number of variants that are simulated side by side: their samples in 40 s take some 30 MB."""


class Rollout(Protocol):
    """Interface between a diagnosis and a simulator."""

    def __call__(self, variants: Sequence[Settings]) -> tuple[Iterator[Array], float]:
        """Simulated samples of the log's channels at the log's times, in chunks of variants (variants of the
        chunk, channels, rows), and the integration step in s. It is the same for all variants, since results
        of different steps differ slightly and cannot be compared."""
        ...


_ZONES = [Plant._fields.index(f"dead_zone_{side}") for side in ("left", "right")]


@dataclass(frozen=True, slots=True)
class Habits:
    """Properties of controller and gears that the recording does not state.

    chain: the sensor chain. brake: whether duty 0 brakes; rows that state it override this.
    commands_precede_rows: whether the command of a row was in force until the row instead of from it on.
    sliding: how wheels slide. low_pass: whether the gyro's chip filters the turn rate. swing_period: period
    in s of swinging commands, 0 if they do not swing; see `excitation.swing_period`. firmware: the
    controller's, if the recording names it; none of its habits is then searched for. fits_sample_ages:
    whether each motor's sample age is fitted, since a controller in step with the rows may sample at any time
    in them; one with its own clock samples in the middle on average. ramp: a limit on the rate of commands
    before the motors get them, None if there is none.
    """

    chain: Chain
    brake: bool
    commands_precede_rows: bool = False
    sliding: WheelSliding = WheelSliding.COMPLIANT
    low_pass: bool = False
    swing_period: float = 0.0
    firmware: Firmware | None = None
    fits_sample_ages: bool = False
    ramp: Ramp | None = None

    @property
    def wombat(self) -> bool:
        """Whether the recording names a Wombat's firmware."""
        return self.firmware is not None and self.firmware.wombat

    @property
    def knows_battery(self) -> bool:
        """Whether only the firmware filters the battery's readings, which is known if the recording itself
        names it. Those in a CSV file may be filtered further: RaccoonOS's programs add 0.05 of each new
        reading."""
        return self.firmware is not None and self.firmware.is_named_by_recording


class PlantRollout:
    """The package's plant driven by one log's commands.

    A dead zone of the readings acts where the log's readings are 0; see `censor_readings`. plain: it acts
    where the simulated readings are small, as in the simulator: for a log that has no readings yet, and to
    judge what a simulator would read. own: a team's effects, written in Python instead of as terms of the
    plant.
    """

    def __init__(
        self,
        log: Log,
        robot: RobotConfig,
        habits: Habits,
        plain: bool = False,
        own: Sequence[OwnEffect] = (),
    ) -> None:
        self._robot = robot
        check_nominal(robot.model)
        cycle = _controller_cycle(median_step(log.time), habits.chain.cycle)
        self._habits = replace(habits, chain=replace(habits.chain, cycle=cycle))
        self._bemf = {} if plain else _bemf_channels(log)
        self._max_silent_counts = 0.0 if habits.firmware is None else habits.firmware.max_silent_counts
        names = column_names(robot)
        self._names = tuple(names[each.role] for each in log.channels)
        self._roles = tuple(each.role for each in log.channels)
        self._own = tuple(own)
        self._time, self._duty = log.time, np.clip(log.duty, -1.0, 1.0)
        self._brake = np.full(log.duty.shape, habits.brake) if log.brake is None else log.brake
        self._clocks = log.clocks
        if habits.commands_precede_rows:
            self._duty, self._brake = (np.concatenate([a[1:], a[-1:]]) for a in (self._duty, self._brake))
        if habits.ramp is not None:
            self._duty = habits.ramp.given(self._time, self._duty)
        self._commands = self._plant_commands(self._duty)

    def __call__(self, variants: Sequence[Settings]) -> tuple[Iterator[Array], float]:
        lanes = self._lanes(variants)
        possible = time_constants(lanes.plant) >= SHORTEST
        step = min(LOOSE_STEP, safe_step(lanes.plant[possible])) if possible.any() else LOOSE_STEP
        parts = (
            slice(start, start + VARIANTS_AT_ONCE) for start in range(0, len(variants), VARIANTS_AT_ONCE)
        )
        return (
            self._simulate_part(variants[each], _select_lanes(lanes, each), possible[each], step)
            for each in parts
        ), step

    def samples(self, variants: Sequence[Settings]) -> Array:
        """Simulated samples of all variants, (variants, channels, rows)."""
        return np.concatenate(list(self(variants)[0]))

    def _simulate_part(
        self, variants: Sequence[Settings], lanes: Lanes, possible: Possible, step: float
    ) -> Array:
        """Samples, NaN for impossible robots: a fit may try some with nearly no inertia."""
        if possible.all():
            return self._comparable_samples(variants, lanes, step)
        samples = np.full((len(variants), len(self._roles), len(self._time)), np.nan)
        if possible.any():
            able = [each for each, can in zip(variants, possible, strict=True) if can]
            samples[possible] = self._comparable_samples(able, _select_lanes(lanes, possible), step)
        return samples

    def _comparable_samples(self, variants: Sequence[Settings], lanes: Lanes, step: float) -> Array:
        """Samples in the form in which they are compared with the log's: averaged, delayed, and censored by
        dead zones."""
        samples = (
            self._with_own_effects(variants, step)
            if self._own
            else self._samples(lanes, self._commands, step)
        )
        windows = np.array([each.get(WINDOW, 0.0) for each in variants])
        for index, role in enumerate(self._roles):
            if role.startswith("speed_") and windows.any():
                samples[:, index] = average_over_window(self._time, samples[:, index], windows)
            if role.startswith("bemf_") and self._habits.fits_sample_ages:
                ages = np.array([each.get(SAMPLE_AGE[role.removeprefix("bemf_")], 0.0) for each in variants])
                samples[:, index] = samples_at_age(self._time, samples[:, index], ages)
        for index, (side, measured, flickers) in self._bemf.items():
            zones = np.array([each[("bemf.dead_zone", side, "counts")] for each in variants])
            has_zone = zones >= MIN_ZONE_COUNTS
            censored = slice(None) if has_zone.all() else np.flatnonzero(has_zone)
            readings = samples[censored, index]
            samples[censored, index] = censor_readings(
                readings, zones[censored, None], measured, flickers, self._max_silent_counts
            )
        return samples

    def _plant_commands(self, duty: Array) -> Commands:
        given = Commands.of_wheels(self._time, duty[:, 0], duty[:, 1], self._brake)
        wheels = ((given.left, given.closed_left), (given.right, given.closed_right))
        (left, closed_left), (right, closed_right) = (
            each if clock is None else clock.in_force(self._time, *each)
            for clock, each in zip(self._clocks, wheels, strict=True)
        )
        return Commands(self._time, left, right, closed_left, closed_right)

    def _samples(self, lanes: Lanes, commands: Commands, step: float) -> Array:
        """Sensor readings, (variants, channels, rows)."""
        run = rollout(lanes, commands, channels=self._names, longest_step=step, readings_only=True)
        stacked = np.stack([run[name].T for name in self._names])  # in the lanes' memory order
        return stacked.transpose(2, 0, 1)

    def _with_own_effects(self, variants: Sequence[Settings], step: float) -> Array:
        """`_samples` with a team's own effects: robots with the same commands are simulated side by side."""
        acting = [
            [(own, values) for own in self._own if (values := _own_values(own, each)) != own.neutral()]
            for each in variants
        ]
        by_commands: dict[str, list[int]] = {}
        for index, effects in enumerate(acting):
            changing = [(own.id, values) for own, values in effects if own.commands is not None]
            by_commands.setdefault(repr(changing), []).append(index)
        samples = np.empty((len(variants), len(self._roles), len(self._time)))
        for group in by_commands.values():
            duty = self._duty
            for own, values in acting[group[0]]:
                duty = own.change_commands(self._time, duty, values)
            lanes = self._lanes([variants[each] for each in group])
            samples[group] = self._samples(lanes, self._plant_commands(duty), step)
        for index, effects in enumerate(acting):
            for own, values in effects:
                readings = dict(zip(self._roles, samples[index], strict=True))
                changed = own.change_readings(Simulated(self._time, self._duty, readings), values)
                samples[index] = [changed[role] for role in self._roles]
        return samples

    def path(self, settings: Settings) -> tuple[Array, Array]:
        """Simulated x and y in m, each (rows,), of a robot with these settings."""
        channels = ("truth.x", "truth.y")
        run = rollout(self._lanes([settings]), self._commands, channels=channels, longest_step=LOOSE_STEP)
        return run["truth.x"][0], run["truth.y"][0]

    def _lanes(self, variants: Sequence[Settings]) -> Lanes:
        """Plant numbers of all variants. Packed here, since `Lanes.of` requires one robot.toml and inertias
        differ."""
        chain = self._habits.chain
        robots_by_inertia: dict[tuple[float, float], RobotConfig] = {}
        robots = [
            cast(Parameters, Variant(self._robot_with_inertias(each, robots_by_inertia), chain, each))
            for each in variants
        ]
        first = robots[0]
        plant = np.array([plant_numbers(each, checked=True) for each in robots])
        if self._bemf:
            plant[:, _ZONES] = 0.0
        return Lanes(
            plant=plant,
            gyro=np.array([gyro_numbers(each, self._robot) for each in variants]),
            signs=(1.0, 1.0),  # of readings and commands: the log's signs are already removed
            ports=(self._robot.drive.left, self._robot.drive.right),
            slots=sample_slots(first),
            cycle=chain.cycle,
        )

    def _robot_with_inertias(
        self, settings: Settings, made: dict[tuple[float, float], RobotConfig]
    ) -> RobotConfig:
        """The robot with the settings' inertias. made: cache of robots by their factors, which most variants
        share."""
        straight, turn = settings[("inertia", None, "straight")], settings[("inertia", None, "turn")]
        if (straight, turn) not in made:
            plain = straight == turn == 1.0
            robot = self._robot if plain else with_inertia(self._robot, straight, turn)
            check_section(robot.model, "drive")  # the section of the inertias; the rest is unchanged
            made[straight, turn] = robot
        return made[straight, turn]


def _select_lanes(lanes: Lanes, which: slice | Possible) -> Lanes:
    """Some of the robots."""
    return replace(lanes, plant=lanes.plant[which], gyro=lanes.gyro[which])


def _controller_cycle(row: float, usual: float) -> float:
    """Period in s at which the controller samples, such that the recording's usual row is a whole number of
    cycles.

    Rows much shorter than a cycle do not determine it; otherwise a row shorter than any cycle is one cycle.
    """
    cycles = round(row / usual)
    return max(row / cycles, SHORTEST_CYCLE) if cycles else usual


def _own_values(own: OwnEffect, settings: Settings) -> dict[str, float]:
    return {each.name: settings[(own.id, None, each.name)] for each in own.parameters}


def _bemf_channels(log: Log) -> dict[int, tuple[str, Array, NDArray[np.bool_]]]:
    """The back-EMF channels of a log by their index: side, samples, and which of them flicker."""
    return {
        index: (each.role.removeprefix("bemf_"), each.values, find_flickers(each.values))
        for index, each in enumerate(log.channels)
        if each.role.startswith("bemf_")
    }
