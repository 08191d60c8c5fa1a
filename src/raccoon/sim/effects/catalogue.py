"""The catalogue of effects: id, a sentence, and parameters with unit and bounds."""

from __future__ import annotations

import math

from raccoon.core.schema import Bounds
from raccoon.model.reflectance import MAX_HEIGHT, MIN_HEIGHT
from raccoon.sim.effects.effect import Effect, Parameter, Place

_POSITIVE = Bounds(positive=True)
_SHARE = Bounds(-0.95, 0.95)


def _factor(width: float, low: float = 0.2, high: float = 5.0) -> tuple[Parameter, ...]:
    return (Parameter("factor", "", 1.0, Bounds(low, high), width),)


_BATTERY = (
    Effect(
        "battery.open_circuit_voltage",
        "The battery is fuller or emptier than assumed, so everything runs faster or slower.",
        (Parameter("voltage", "V", None, Bounds(1.0, 30.0), 0.3),),
    ),
    Effect(
        "battery.internal_resistance",
        "The battery's voltage sags under load: driving hard or with both motors makes each of them weaker.",
        (Parameter("resistance", "ohm", None, Bounds(0.0, 2.0), 0.05),),
    ),
    Effect(
        "battery.discharge",
        "The battery empties while driving, so the robot gets slower during the run.",
        (Parameter("volts_per_coulomb", "V/C", 0.0, Bounds(0.0, 0.5), 0.01),),
    ),
)

_MOTOR = (
    Effect(
        "motor.armature_resistance",
        "The winding's resistance differs from the nominal one: less torque when it is higher.",
        _factor(0.1),
        Place.SIDE,
    ),
    Effect(
        "motor.back_emf_constant",
        "The motor's magnets are stronger or weaker than assumed: another speed at the same voltage.",
        _factor(0.04),
        Place.SIDE,
    ),
    Effect(
        "motor.heating",
        "The winding gets hot under load and its resistance rises.",
        (
            Parameter("gain", "1/A2", 0.0, Bounds(0.0, 10.0), 0.5),
            Parameter("time_constant", "s", None, Bounds(0.5, 600.0), 10.0, initial=20.0),
        ),
        Place.SIDE,
    ),
    Effect(
        "motor.current_limit",
        "The driver limits the current.",
        (Parameter("limit", "A", math.inf, _POSITIVE, 1.0),),
        Place.SIDE,
    ),
)

_FRICTION = (
    Effect(
        "friction.coulomb",
        "More or less dry friction than assumed: a torque that opposes any motion.",
        (Parameter("torque", "N m", None, Bounds(0.0, 5.0), 0.05),),
        Place.SIDE,
    ),
    Effect(
        "friction.viscous",
        "More or less friction that grows with speed than assumed.",
        (Parameter("coefficient", "N m s/rad", None, Bounds(0.0, 2.0), 0.01),),
        Place.SIDE,
    ),
    Effect(
        "friction.stiction",
        "Breaking loose takes more torque than keeping moving.",
        (
            Parameter("torque", "N m", 0.0, Bounds(0.0, 5.0), 0.03),
            Parameter("speed", "rad/s", None, Bounds(0.02, 10.0), 0.5, initial=0.5),
        ),
        Place.SIDE,
    ),
    Effect(
        "friction.load_dependent",
        "The friction of the gear grows with the torque that it transmits.",
        (Parameter("coefficient", "", 0.0, Bounds(0.0, 0.9), 0.1),),
        Place.SIDE,
    ),
    Effect(
        "friction.direction_dependent",
        "Friction is higher in one direction of turning: forward if the number is positive.",
        (
            Parameter("asymmetry", "", 0.0, _SHARE, 0.2),
            Parameter("viscous_asymmetry", "", 0.0, _SHARE, 0.2),
        ),
        Place.SIDE,
    ),
    Effect(
        "friction.quadratic",
        "A drag that grows with the square of the speed.",
        (Parameter("coefficient", "N m s2/rad2", 0.0, Bounds(0.0, 0.5), 0.001),),
        Place.SIDE,
    ),
    Effect(
        "friction.presliding",
        "Friction gives a little before it slides, like the bristles of a brush: a wheel that stops swings "
        "a few times, by some counts of its back-EMF. Or it creeps: friction is a curve over the speed. Up "
        "to the part `break_away` of its level it is elastic, and does not creep at all.",
        (
            Parameter("compliance", "rad/(N m)", 0.0, Bounds(0.0, 0.05), 0.001),
            Parameter("damping", "N m s/rad", None, Bounds(0.0, 20.0), 0.3, initial=0.3),
            Parameter("creep", "rad/s", 0.0, Bounds(0.0, 1.0), 0.05),
            Parameter("creep_tail", "", None, Bounds(0.0, 1.0), 0.5, initial=0.0),
            Parameter("break_away", "", 0.0, Bounds(0.0, 0.98), 0.85),
        ),
    ),
)

_DRIVE = (
    Effect(
        "drive.backlash",
        "The gears have play: after a reversal the motor turns before the wheel does.",
        (
            Parameter("angle", "rad", 0.0, Bounds(0.0, 1.0), 0.05),
            Parameter("coasting", "s", None, Bounds(0.0, 1.0), 0.01, 0.0),
        ),
        Place.SIDE,
    ),
    Effect(
        "drive.wheel_slip",
        "The wheels slip while they speed up or brake, so the robot lags behind them.",
        (
            Parameter("time", "s", 0.0, Bounds(0.0, 0.2), 0.01),
            Parameter("at_once", "", None, Bounds(0.0, 1.0), 1.0, 0.0),
        ),
        Place.SIDE,
    ),
    Effect(
        "drive.turn_scrub",
        "Turning, on the spot or in an arc, scrubs wheels and caster over the floor: a torque at each wheel.",
        (Parameter("torque", "N m", 0.0, Bounds(0.0, 2.0), 0.03),),
    ),
    Effect(
        "drive.wheel_radius",
        "A wheel is larger or smaller than assumed.",
        _factor(0.02, 0.5, 2.0),
        Place.SIDE,
    ),
    Effect(
        "drive.track_width",
        "The wheels touch the floor further apart or closer together than assumed.",
        _factor(0.03, 0.3, 3.0),
    ),
    Effect(
        "drive.inertia",
        "The robot is heavier or lighter than assumed (a payload): it speeds up differently.",
        _factor(0.2, 0.1, 10.0),
    ),
    Effect(
        "drive.slope",
        "The floor is not level: a constant pull towards one side of the table, a torque at each wheel.",
        (
            Parameter("along_x", "N m", 0.0, Bounds(-1.0, 1.0), 0.02),
            Parameter("along_y", "N m", 0.0, Bounds(-1.0, 1.0), 0.02),
        ),
    ),
    Effect(
        "drive.wheel_eccentricity",
        "A wheel runs out of round: the path wobbles once a turn.",
        (
            Parameter("amplitude", "", 0.0, Bounds(0.0, 0.5), 0.01),
            Parameter("phase", "rad", None, Bounds(-2 * math.pi, 2 * math.pi), math.pi, initial=0.0),
        ),
        Place.SIDE,
    ),
)

_ACTUATION = (
    Effect(
        "actuation.deadband",
        "Small commands do nothing at all.",
        (Parameter("duty", "", 0.0, Bounds(0.0, 0.5), 0.02),),
        Place.SIDE,
    ),
    Effect(
        "actuation.latency",
        "Commands reach the motors late.",
        (Parameter("seconds", "s", 0.0, Bounds(0.0, 0.25), 0.01),),
    ),
)

_BEMF = (
    Effect(
        "bemf.offset",
        "The back-EMF reading is not zero at standstill: phantom motion.",
        (Parameter("counts", "counts", None, Bounds(-400.0, 400.0), 10.0),),
        Place.SIDE,
    ),
    Effect(
        "bemf.scale",
        "The back-EMF reading is too large or too small by a factor.",
        _factor(0.03),
        Place.SIDE,
    ),
    Effect(
        "bemf.dead_zone",
        "Small back-EMF readings are reported as zero, after offset and filter: slow creeping goes unseen.",
        (Parameter("counts", "counts", 0.0, Bounds(0.0, 400.0), 10.0),),
        Place.SIDE,
    ),
    Effect(
        "bemf.filter_lag",
        "The controller smooths back-EMF more or less than assumed.",
        (Parameter("time_constant", "s", None, Bounds(0.0, 0.5), 0.01),),
        Place.SIDE,
    ),
)

_IMU = (
    Effect(
        "imu.gyro_bias",
        "The gyro reads a turn rate at rest.",
        (Parameter("rate", "rad/s", None, Bounds(-0.5, 0.5), 0.005),),
    ),
    Effect(
        "imu.gyro_scale",
        "The gyro reads too much or too little by a factor.",
        _factor(0.02, 0.5, 2.0),
    ),
    Effect(
        "imu.gyro_drift",
        "The gyro's reading at rest changes with time.",
        (Parameter("rate_per_second", "rad/s2", 0.0, Bounds(-0.05, 0.05), 0.0005),),
    ),
    Effect(
        "imu.latency",
        "Gyro readings arrive late.",
        (Parameter("seconds", "s", 0.0, Bounds(0.0, 0.25), 0.01),),
    ),
    Effect(
        "imu.low_pass",
        "The gyro's chip smooths the turn rate: a filter of first order.",
        (Parameter("time_constant", "s", 0.0, Bounds(0.0, 0.05), 0.004),),
    ),
)

_TOPHAT = (
    Effect(
        "tophat.ambient_light",
        "Light from outside shifts the tophat's reading.",
        (Parameter("offset", "counts", 0.0, Bounds(-4095.0, 4095.0), 100.0),),
        Place.TOPHAT,
    ),
    Effect(
        "tophat.gain",
        "The tophat's reading is stretched or squeezed by a factor.",
        _factor(0.1, 0.01, 10.0),
        Place.TOPHAT,
    ),
    Effect(
        "tophat.height",
        "The tophat sits higher or lower above the floor than assumed.",
        (Parameter("height", "m", 0.007, Bounds(MIN_HEIGHT, MAX_HEIGHT), 0.003),),
        Place.TOPHAT,
    ),
    Effect(
        "tophat.noise",
        "The tophat's reading is noisier than usual.",
        (Parameter("sd", "counts", 0.0, Bounds(0.0, 2000.0), 10.0),),
        Place.TOPHAT,
    ),
)

CATALOGUE: dict[str, Effect] = {
    each.id: each for each in (*_BATTERY, *_MOTOR, *_FRICTION, *_DRIVE, *_ACTUATION, *_BEMF, *_IMU, *_TOPHAT)
}
