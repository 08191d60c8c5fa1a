"""Commands to the Wombat's RaccoonOS firmware: each frame is one packed struct with the complete command.

Modes, targets and servos have no flag: every frame sets them, so a frame of zeros stops everything. Gains,
matrices and resets take effect only if their bit of `updates` is set, which must be done in a single frame.
Motors have the unified polarity of `devices` here; the wire has RaccoonOS's own.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from raccoon.core.errors import ConfigError
from raccoon.core.readings import STOP, Outputs
from raccoon.hal.wombat.firmware.devices import RACCOON_POLARITY
from raccoon.hal.wombat.firmware.raccoon.wire import FRAME_LENGTH

FULL_PWM = 400


class Mode(IntEnum):
    """Mode of a motor; three bits a motor."""

    OFF = 0
    BRAKE = 1
    PWM = 2
    SPEED = 3
    POSITION = 4
    CHASSIS = 5
    """Version 21: all four wheels follow the velocity of the chassis."""


class Update(IntFlag):
    """Parts of a frame that take effect once, if their bit is set."""

    VELOCITY_PID = 0x01
    POSITION_PID = 0x02
    IMU_ORIENTATION = 0x04
    SAVE_IMU_CALIBRATION = 0x08
    KINEMATICS = 0x10
    ODOMETRY_RESET = 0x20
    POSITION_RESET = 0x40
    FEATURES = 0x80


class Shutdown(IntFlag):
    """Stops that stay in force while their bit is set."""

    SERVOS = 1
    MOTORS = 2


class ServoMode(IntEnum):
    """Mode of a servo; two bits a servo. The servos' supply is off while all four are OFF."""

    OFF = 0
    DISABLED = 1
    ENABLED = 2


Gains = tuple[float, float, float]
Floats4 = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class MotorPid:
    """Limits of output and integral, filter constant, and (Kp, Ki, Kd) of each motor."""

    limits: Floats4 = (0.0, 0.0, 0.0, 0.0)
    tau: float = 0.0
    gains: tuple[Gains, Gains, Gains, Gains] = ((0.0, 0.0, 0.0),) * 4


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Matrices and scales between wheels and chassis, row by row.

    inverse: 3x4, wheel speeds (rad/s) to vx, vy, wz. ticks_to_rad: rad per position tick. bemf_offset: counts
    (version 21). forward: 4x3, vx, vy, wz to wheel speeds.
    """

    inverse: tuple[float, ...] = (0.0,) * 12
    ticks_to_rad: Floats4 = (0.0, 0.0, 0.0, 0.0)
    bemf_offset: Floats4 = (0.0, 0.0, 0.0, 0.0)
    forward: tuple[float, ...] = (0.0,) * 12


@dataclass(frozen=True, slots=True)
class Command:
    """Every field of a frame.

    targets: PWM -400..400, counts, or the speed limit of a position move, by the mode. goals: ticks. All by
    motor port. chassis_velocity and disable_bemf exist only in version 21 and must keep their defaults in 17.
    """

    updates: Update = Update(0)
    shutdown: Shutdown = Shutdown(0)
    modes: tuple[Mode, Mode, Mode, Mode] = (Mode.OFF,) * 4
    targets: tuple[int, int, int, int] = (0, 0, 0, 0)
    chassis_velocity: Gains = (0.0, 0.0, 0.0)
    goals: tuple[int, int, int, int] = (0, 0, 0, 0)
    position_reset: int = 0
    servo_modes: tuple[ServoMode, ServoMode, ServoMode, ServoMode] = (ServoMode.OFF,) * 4
    servo_us: tuple[int, int, int, int] = (0, 0, 0, 0)
    pid: MotorPid = MotorPid()
    gyro_orientation: tuple[int, ...] = (0,) * 9
    compass_orientation: tuple[int, ...] = (0,) * 9
    kinematics: Kinematics = Kinematics()
    disable_bemf: bool = False


_FULL = {
    17: struct.Struct("<BIBH4i4iBB4H5f12f9b9b12f4f12f"),
    21: struct.Struct("<BIBH4i3f4iBB4H5f12f9b9b12f4f4f12fB"),
}


def encode_command(command: Command, version: int) -> bytes:
    """A frame with every field.

    Raises ConfigError for a field that the version does not have and for a value that does not fit its field.
    """
    if version not in _FULL:
        raise ConfigError(f"RaccoonOS protocol version {version}: allowed are {sorted(_FULL)}")
    newer = version >= 21
    if not newer:
        _refuse_newer_fields(command)
    fields: list[float] = [
        version,
        command.updates,
        command.shutdown,
        sum(mode << 3 * port for port, mode in enumerate(command.modes)),
        *(RACCOON_POLARITY * target for target in command.targets),
        *(command.chassis_velocity if newer else ()),
        *(RACCOON_POLARITY * goal for goal in command.goals),
        command.position_reset,
        sum(mode << 2 * port for port, mode in enumerate(command.servo_modes)),
        *command.servo_us,
        *_pid_fields(command.pid),
        *command.gyro_orientation,
        *command.compass_orientation,
        *_kinematics_fields(command.kinematics, newer),
        *((int(command.disable_bemf),) if newer else ()),
    ]
    try:
        return _FULL[version].pack(*fields)
    except (struct.error, OverflowError) as error:
        raise ConfigError(f"{command} does not fit a frame of version {version}: {error}") from error


def _refuse_newer_fields(command: Command) -> None:
    newer = command.disable_bemf or any(command.chassis_velocity) or any(command.kinematics.bemf_offset)
    if newer or Mode.CHASSIS in command.modes or Update.FEATURES in command.updates:
        raise ConfigError(
            "chassis velocity, back-EMF offset and feature flags: version 17 has no such fields"
        )


def _pid_fields(pid: MotorPid) -> list[float]:
    return [*pid.limits, pid.tau, *(gain for motor in pid.gains for gain in motor)]


def _kinematics_fields(kinematics: Kinematics, newer: bool) -> list[float]:
    offset = kinematics.bemf_offset if newer else ()
    return [*kinematics.inverse, *kinematics.ticks_to_rad, *offset, *kinematics.forward]


def stop(version: int) -> bytes:
    """The frame that shuts down motors and servos."""
    return encode_command(Command(shutdown=Shutdown.SERVOS | Shutdown.MOTORS), version)


_SERVO_OFFSET = {17: 40, 21: 52}
_SERVO_LENGTH = 10
# The targets and zeros; the same with servos, which follow the goals (and in 21 the chassis velocity).
_MOTORS = {version: struct.Struct(f"<BIBH4i{length - 24}x") for version, length in FRAME_LENGTH.items()}
_SERVOS = {
    version: struct.Struct(f"<BIBH4i{offset - 24}xBB4H{FRAME_LENGTH[version] - offset - _SERVO_LENGTH}x")
    for version, offset in _SERVO_OFFSET.items()
}
_BRAKE, _PWM = int(Mode.BRAKE), int(Mode.PWM)
_SCALE = RACCOON_POLARITY * FULL_PWM


def encode(outputs: Outputs, version: int) -> bytes:
    """The complete command of one cycle as a frame. Duty 0 coasts, or brakes if `outputs.brake` says so."""
    duty0, duty1, duty2, duty3 = outputs.duty
    brake0, brake1, brake2, brake3 = outputs.brake
    t0, t1 = round(duty0 * _SCALE), round(duty1 * _SCALE)
    t2, t3 = round(duty2 * _SCALE), round(duty3 * _SCALE)
    modes = (
        (_PWM if t0 else _BRAKE * brake0)
        | (_PWM if t1 else _BRAKE * brake1) << 3
        | (_PWM if t2 else _BRAKE * brake2) << 6
        | (_PWM if t3 else _BRAKE * brake3) << 9
    )
    pulses = outputs.servo_us
    if pulses == STOP.servo_us:
        return _MOTORS[version].pack(version, 0, 0, modes, t0, t1, t2, t3)
    enabled = sum(ServoMode.ENABLED << 2 * port for port, pulse in enumerate(pulses) if pulse is not None)
    lengths = (pulse or 0 for pulse in pulses)
    return _SERVOS[version].pack(version, 0, 0, modes, t0, t1, t2, t3, 0, enabled, *lengths)
