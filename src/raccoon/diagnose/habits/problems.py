"""The problem of a drive under a controller's habits: what is compared, simulated, and may differ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT
from raccoon.diagnose.drives.features import Features, bin_width
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.fit.problem import BatteryCreep, Point, Problem
from raccoon.diagnose.habits.habit_fits import with_all_base_free
from raccoon.diagnose.habits.lost_commands import restore_lost_changes
from raccoon.diagnose.hypotheses.base_coordinates import base_coordinates
from raccoon.diagnose.hypotheses.cause_catalogue import causes_from
from raccoon.diagnose.hypotheses.coordinates import Cause, Settings, neutral_settings
from raccoon.diagnose.hypotheses.per_recording import per_recording_coordinates, per_recording_settings
from raccoon.diagnose.rollout.dead_zone_evidence import dead_zone_evidence
from raccoon.diagnose.rollout.encoder_window import encoder_coordinates, encoder_settings
from raccoon.diagnose.rollout.joined_rollout import make_rollout
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.sample_ages import age_coordinates, age_settings
from raccoon.sim.effects.parameters import Parameters

HELD_BATTERY_CREEP = BatteryCreep(1.5 * BATTERY_VOLTS_PER_COUNT, 1.5)
"""Creep of a battery's reading that is held between two edges. It is off by a count or so until its load
changes: by 0.6 to 1.1 counts around a mean of 0.5 to 1.5, for a second, in six drives of fault-free robots
behind the emulated stock firmware. With one count for ten seconds, drives of 9 s had a battery's resistance
beside a scrub, a reading's scale in the place of viscous friction, and something unknown on one of three
fault-free robots."""


def drive_problem(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], habits: Habits, model: Parameters | None
) -> Problem:
    """The problem of a drive under a controller's habits."""
    own = [each.own for each in causes if each.own is not None]
    battery = robot.model.battery.internal_resistance.value if log.separate_batteries else 0.0
    settings = starting_settings(robot, model) | encoder_settings(log)
    settings |= per_recording_settings(len(log.runs), battery)
    settings |= age_settings() if habits.fits_sample_ages else {}
    for each in own:
        settings |= {(each.id, None, name): value for name, value in each.neutral().items()}
    by_name = causes_from(causes, settings)
    base = (
        *base_coordinates(
            robot,
            sliding=habits.sliding,
            low_pass=habits.low_pass,
            free_running=habits.chain.free_running,
            wombat=habits.wombat,
            fit_sample_ages=habits.fits_sample_ages,
        ),
        *encoder_coordinates(log),
        *(age_coordinates() if habits.fits_sample_ages else ()),
        *per_recording_coordinates(len(log.runs), battery),
    )
    return Problem(
        Features.cached(log, habits.swing_period or bin_width(log)),
        make_rollout(log, robot, habits, own),
        robot,
        settings,
        tuple(each.beside(settings) for each in base),
        by_name,
        dead_zone_evidence(by_name, log),
        HELD_BATTERY_CREEP if habits.chain.battery_held else BatteryCreep(),
        habits.chain.coast_share,
        log.friction_may_change,
        log.change,
    )


def starting_settings(robot: RobotConfig, model: Parameters | None) -> Settings:
    """The simulation's settings before any diagnosis; a model's inertias are factors on robot.toml's."""
    settings = neutral_settings(robot)
    if model is None:
        return settings
    for id_, place, name in settings:
        if id_ != "inertia":
            settings[(id_, place, name)] = model.value(id_, name, place)
    own, given = robot.model.drive, model.robot.model.drive
    straight = given.inertia_straight.value / own.inertia_straight.value
    settings[("inertia", None, "straight")] = straight
    settings[("inertia", None, "turn")] = given.inertia_turn.value / own.inertia_turn.value
    return settings


def free_problem_of(
    robot: RobotConfig, causes: Sequence[Cause], habits: Habits, model: Parameters | None
) -> Callable[[Log], Problem]:
    """A function from a log to its problem under habits, with all base numbers free: see
    `with_all_base_free`."""
    return lambda log: with_all_base_free(drive_problem(log, robot, causes, habits, model), habits.sliding)


def with_lost_changes(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    habits: Habits,
    model: Parameters | None,
    point: Point,
) -> Log:
    """The log with changes of commands in lost rows placed where they fit the simulation of `point` best."""
    habits = replace(habits, swing_period=0.0)  # a wheel responds within a swing
    return restore_lost_changes(log, lambda each: drive_problem(each, robot, causes, habits, model), point)
