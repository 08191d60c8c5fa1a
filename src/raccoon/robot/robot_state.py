"""The state of a robot: its readings, the estimates from them, its sensors and servos by name."""

from __future__ import annotations

from sys import _getframe
from typing import TYPE_CHECKING, Never, NoReturn, Protocol, TypeVar, runtime_checkable

from raccoon.core.config import RobotConfig
from raccoon.core.errors import HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import (
    ANALOG_PORTS,
    DIGITAL_PORTS,
    NO_ANALOG,
    NO_DIGITAL,
    SIMULATOR,
    STOP,
    Flags,
    Inputs,
    Outputs,
    Words,
)
from raccoon.estimate.battery.state import PackState
from raccoon.estimate.battery.voltage import BatteryVoltage
from raccoon.model.pose import Pose
from raccoon.robot.actions.limits import check_kind, check_port
from raccoon.robot.motions.goals import PLAN_REACH, PLAN_REACH_HEADING
from raccoon.robot.name_hints import hint_for_name
from raccoon.robot.parts.attachments import Attachments, find_named
from raccoon.robot.parts.drive import Drive
from raccoon.robot.parts.tophats import TophatSensor
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.estimate.drive.estimate import DriveEstimate
    from raccoon.robot.parts.mechanism import Mechanism
    from raccoon.robot.parts.servos import Servo

Word = TypeVar("Word")
_BLANK_INPUTS = Inputs(0.0, SIMULATOR)

MAX_STANDING_READINGS = 1000
"""Readings with the same time after which a port's clock counts as stopped."""
REMARK_AFTER_ASKED = 1000
"""Accesses to the readings in one cycle from which a program seems to wait for them to change."""
REFUSE_AFTER_ASKED = 1_000_000
"""Accesses after which it would wait for ever."""


@runtime_checkable
class Annotated(Protocol):
    """A port that takes the robot's estimates: a recording stores them, a replay checks them."""

    def annotate(self, name: str, values: tuple[float, ...]) -> None:
        """Numbers of this cycle under a name."""
        ...

    def event(self, text: str) -> None:
        """A remark of this cycle."""
        ...


class RobotState:
    """State of a robot behind `port`, described by `config`. `Robot` adds the loop that reads and drives."""

    def __init__(self, port: Port, config: RobotConfig | None = None) -> None:
        from raccoon.estimate.drive.odometry import Odometry

        if not hasattr(port, "read"):
            raise TypeError(
                f"the port of a Robot is {port!r}: it must be a Port; `with open_robot(...) as robot:` opens "
                "the one that robot.toml names"
            )
        if config is not None:
            check_kind(config, RobotConfig, "Robot(): config", "; load_robot(path) reads one")
        self.config = RobotConfig() if config is None else config
        self.port = port
        self.odometry = Odometry(self.config)
        self.drive = Drive(self.config)
        self.drive.followed = getattr(port, "follows_commands", True)
        self.battery = BatteryVoltage()
        battery = self.config.model.battery.internal_resistance
        self.pack = PackState(
            self.config.battery.chemistry, self.config.battery.cells, battery.value, max(battery.std, 0.05)
        )
        self.attachments = Attachments(self.config)
        self.tophats = {name: TophatSensor(name, each) for name, each in self.config.tophats.items()}
        self.inputs: Inputs | None = None
        self._analog: Words = NO_ANALOG
        self._digital: Flags = NO_DIGITAL
        self._outputs = STOP
        self._plan: Pose | None = None
        self._plan_resets = 0  # the odometry's resets so far
        self._annotated_port: Annotated | None = port if isinstance(port, Annotated) else None
        self._standing_readings = 0  # readings in a row whose time was none later
        self._asked_times = 0  # times that the program asked for readings of this cycle

    if not TYPE_CHECKING:  # a type checker knows that it has nothing else

        def __getattr__(self, name: str) -> object:
            if hasattr(type(self), name):  # there is one, and it failed: with its own error
                return object.__getattribute__(self, name)
            raise AttributeError(f"a robot has no {name}{hint_for_name(name, self.__dict__.get('config'))}")

    def _count_asked(self) -> None:
        """Count an access to the readings: a loop around them alone never sees new ones. Raises RuntimeError
        if it must be such a loop."""
        self._asked_times += 1
        if self._asked_times % REMARK_AFTER_ASKED == 0 and not _getframe(2).f_globals.get(
            "__name__", ""
        ).startswith("raccoon."):
            said = (
                f"readings were asked for {self._asked_times} times in one cycle, in which they do not "
                "change: the robot reads its sensors only in run() and tick(); wait with "
                "robot.run(wait_for(...)) for a condition such as pressed(0) or analog_above(0, 2000), or "
                "call robot.tick() in the loop"
            )
            add_remark(self, said)
            if self._asked_times >= REFUSE_AFTER_ASKED:
                raise RuntimeError(said)

    @property
    def time(self) -> float:
        """s, of the last reading."""
        self._count_asked()
        return 0.0 if self.inputs is None else self.inputs.time

    @property
    def estimate(self) -> DriveEstimate:
        """Pose, velocity and their standard deviations at the last reading."""
        return self.odometry.estimate

    @property
    def pose(self) -> Pose:
        """The estimated pose."""
        self._count_asked()
        here = self.odometry.estimate
        return Pose(here.x, here.y, here.heading)

    if not TYPE_CHECKING:  # a type checker knows that it is not set

        @pose.setter
        def pose(self, pose: object) -> NoReturn:
            raise AttributeError(
                f"a pose cannot be set directly to {pose}: write robot.odometry.reset(x, y, heading)"
            )

    @property
    def plan(self) -> Pose:
        """The pose at which the last motion was meant to end, from which the next one starts.

        A plan that is far from the estimate (the robot was moved or blocked) is replaced by the estimate, as
        is one from before the odometry was reset.
        """
        here = self.pose
        if self._plan is None or self._plan_resets != self.odometry.resets:
            self.plan = here
            return here
        ahead, aside = self._plan.offset_of(here.x, here.y)
        off = abs(here.heading - self._plan.heading)
        if max(abs(ahead), abs(aside)) > PLAN_REACH or off > PLAN_REACH_HEADING:
            self._plan = here
        return self._plan

    @plan.setter
    def plan(self, pose: Pose) -> None:
        check_kind(pose, Pose, "robot.plan", "; write Pose(x, y, heading)")
        self._plan, self._plan_resets = pose, self.odometry.resets

    def replan(self) -> None:
        """Forget the plan: the next motion starts from the estimate."""
        self._plan = None

    @property
    def battery_voltage(self) -> float | None:
        """V under the present load, filtered; None before the first reading."""
        return self.battery.voltage

    def tophat(self, name: str) -> TophatSensor:
        """The tophat called `name` in robot.toml; ConfigError where there is none."""
        return find_named("tophat", self.tophats, name)

    def servo(self, name: str, *to: Never) -> Servo:
        """The servo called `name` in robot.toml; ConfigError where there is none."""
        if to:
            _refuse_move("servo", "servo", name, to)
        return find_named("servo", self.attachments.servos, name)

    def mechanism(self, name: str, *to: Never) -> Mechanism:
        """The mechanism called `name` in robot.toml; ConfigError where there is none."""
        if to:
            _refuse_move("mechanism", "move", name, to)
        return find_named("mechanism", self.attachments.mechanisms, name)

    def analog(self, port: int) -> float | None:
        """Counts of an analog port at its last reading, None if it never gave one; ValueError if the port
        does not exist. After a cycle without readings, such as a lost frame, these are the previous ones: see
        `inputs`."""
        check_port("analog", port, ANALOG_PORTS)
        self._count_asked()
        return self._analog[port]

    def digital(self, port: int) -> bool | None:
        """Whether the digital port was closed (pressed) at its last reading, None if it never gave one;
        ValueError if the port does not exist."""
        check_port("digital", port, DIGITAL_PORTS)
        self._count_asked()
        return self._digital[port]

    @property
    def button(self) -> bool | None:
        """Whether the controller's own button is pressed, None if this cycle does not say."""
        self._count_asked()
        extra = None if self.inputs is None else self.inputs.extra
        return bool(extra["button"]) if extra is not None and "button" in extra else None

    def _read(self) -> tuple[Inputs, float]:
        """The next readings, and how many s later they are. Raises TypeError if the port gives none,
        ValueError if they do not have a word for each port, HardwareError if its time stands still."""
        inputs = self.port.read()
        if not isinstance(inputs, Inputs):
            raise TypeError(f"read() of {type(self.port).__name__} returns {inputs!r}: it must return Inputs")
        if self.inputs is None:
            _check_words(inputs)
        elapsed = 0.0 if self.inputs is None else inputs.time - self.inputs.time
        self._standing_readings = 0 if elapsed > 0.0 else self._standing_readings + 1
        if self._standing_readings > MAX_STANDING_READINGS:
            stands = (
                f"the port's time has stood still at {inputs.time} s for {MAX_STANDING_READINGS} readings"
            )
            raise HardwareError(f"{stands}: no motion would ever end")
        return inputs, elapsed

    def _keep_words(self, inputs: Inputs) -> None:
        """Keep the newest word of every port."""
        self._asked_times = 0
        analog, digital = inputs.analog, inputs.digital
        self._analog = analog if None not in analog else _newest_words(self._analog, analog)
        self._digital = digital if None not in digital else _newest_words(self._digital, digital)

    @property
    def blind(self) -> tuple[str, ...]:
        """Sentences that name the tophats that cannot see, and why."""
        return tuple(each.complaint for each in self.tophats.values() if each.blind)

    @property
    def outputs(self) -> Outputs:
        """The last command."""
        return self._outputs

    def note(self, text: str) -> None:
        """Write a remark into the recording, if there is one."""
        if self._annotated_port is not None:
            self._annotated_port.event(text)


def _check_words(inputs: Inputs) -> None:
    """Raise ValueError if readings do not have a word for each port."""
    for name in ("bemf", "position", "analog", "digital"):
        words, asked = getattr(inputs, name), getattr(_BLANK_INPUTS, name)
        if not isinstance(words, tuple) or len(words) != len(asked):
            raise ValueError(f"{name} of the port's Inputs is {words!r}: it must be a tuple of {len(asked)}")


def _refuse_move(kind: str, action: str, name: str, to: tuple[object, ...]) -> Never:
    """Raise an error that says how to move something that was only read."""
    given = ", ".join(map(repr, (name, *to)))
    raise TypeError(f"robot.{kind}({name!r}) moves nothing: write robot.run({action}({given}))")


def _newest_words(before: tuple[Word | None, ...], now: tuple[Word | None, ...]) -> tuple[Word | None, ...]:
    return tuple(old if new is None else new for old, new in zip(before, now, strict=True))


def replayed_numbers(estimate: DriveEstimate) -> tuple[float, ...]:
    """What a replay must reproduce: pose, velocities and their standard deviations."""
    return (
        estimate.x,
        estimate.y,
        estimate.heading,
        estimate.velocity,
        estimate.turn_rate,
        estimate.gyro_bias,
        estimate.x_std,
        estimate.y_std,
        estimate.heading_std,
    )
