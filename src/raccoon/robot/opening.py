"""From a robot.toml to a robot that is ready to run, on hardware, in simulation or from a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

from raccoon.core.config import REAL_CONTROLLERS, RobotConfig, load_robot
from raccoon.core.errors import ConfigError, TraceError
from raccoon.core.files import copy_kept_files, near_program, program_folder
from raccoon.core.near_names import did_you_mean_file
from raccoon.core.port import Port, in_real_time
from raccoon.estimate.drive.wheels import all_resting_counts
from raccoon.robot.actions.actions import Action
from raccoon.robot.actions.functions import NOTHING_RUN_HINT, check_program, perform
from raccoon.robot.actions.limits import check_number
from raccoon.robot.loop import punctual, stopped_on_exit
from raccoon.robot.name_hints import add_hints, add_unread_hint
from raccoon.robot.remarks import add_remark
from raccoon.robot.robot import Robot
from raccoon.robot.tracebacks import install_hook

if TYPE_CHECKING:
    from raccoon.trace.format import Trace

T = TypeVar("T")
_is_only_read = ContextVar("only_read", default=False)
"""Whether the running program must not open a robot."""


@contextmanager
def no_robot_opened() -> Iterator[None]:
    """Inside the block `open_robot` raises ConfigError unless it is given a port: a program that is only
    read, simulated or replayed must not move the robot that its robot.toml names."""
    before = _is_only_read.set(True)
    try:
        yield
    finally:
        _is_only_read.reset(before)


@dataclass
class Substitute:
    """What is opened in place of the controller that robot.toml names.

    port: makes the port from a configuration and a seed. record, seed: where to record, and the seed of the
    noise, if the program gives none. robots: those opened so far.
    """

    port: Callable[[RobotConfig, int], Port]
    record: Path | None = None
    seed: int = 0
    robots: list[Robot] = field(default_factory=list)


_substitute: ContextVar[Substitute | None] = ContextVar("_substitute", default=None)


@contextmanager
def substitute_robot(substitute: Substitute) -> Iterator[None]:
    """Inside the block a program that opens the robot of its robot.toml gets this simulated one."""
    before = _substitute.set(substitute)
    try:
        yield
    finally:
        _substitute.reset(before)


class Opening:
    """What `open_robot` returns: the robot of one `with` block, opened when the block is entered."""

    def __init__(self, opened: AbstractContextManager[Robot]) -> None:
        self._opened = opened
        self._entered = False

    def __repr__(self) -> str:
        return "<a robot that is not open: `with open_robot(...) as robot:` opens it>"

    def __enter__(self) -> Robot:
        if self._entered:
            raise RuntimeError(
                "this robot has already been opened: write `with open_robot(...) as robot:` again to open "
                "it again"
            )
        self._entered = True
        return self._opened.__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        add_hints(error)
        return self._opened.__exit__(kind, error, trace)

    if not TYPE_CHECKING:  # a type checker knows that it has nothing else

        def __getattr__(self, name: str) -> object:
            raise AttributeError(
                f"the robot is not open yet, so it has no {name}: write `with open_robot(...) as robot:` "
                "and use it in that block"
            )


def open_robot(
    config: RobotConfig | str | Path = "robot.toml",
    *,
    port: Port | None = None,
    record: str | Path | None = None,
    seed: int | None = None,
) -> Opening:
    """Open a robot for a `with` block. Its motors stop however the block is left, including SIGTERM and
    Ctrl-C.

    config: a configuration, or a robot.toml, looked for in the folder where the program was started and then
    beside the program. port: given by tests; otherwise robot.toml's `controller.port` is opened, and there is
    no fallback to the simulator. record: where to record the run; if the recording exists, the new one gets a
    number (`run-2`), and if it cannot be written there is a RuntimeWarning and the robot runs without it.
    seed: of the simulator. Raises ConfigError, HardwareError, FileNotFoundError; TypeError and ValueError for
    arguments of other kinds.
    """
    if not isinstance(config, RobotConfig | str | Path):
        raise TypeError(f"config is {config!r}: it must be the name of a robot.toml, or a RobotConfig")
    if port is not None and not hasattr(port, "read"):
        raise TypeError(
            f"port is {port!r}: it must be a Port; without one robot.toml's controller.port is opened"
        )
    if seed is not None and (not hasattr(seed, "__index__") or seed < 0):
        raise ValueError(f"seed is {seed!r}: it must be a whole number from 0")
    if record is not None and not isinstance(record, str | Path):
        raise TypeError(f"record is {record!r}: it must be the name of a recording")
    if record is not None and not Path(record).name:
        raise ValueError(f"record is {str(record)!r}: it must be the name of a recording, such as 'run'")
    install_hook()
    return Opening(_open(config, port, record, seed))


@contextmanager
def _open(
    config: RobotConfig | str | Path, port: Port | None, record: str | Path | None, seed: int | None
) -> Iterator[Robot]:
    if port is None and _is_only_read.get():
        raise ConfigError(
            "a program that is imported, swept or replayed must not open a robot: write what it does in "
            "mission(robot)"
            ', and open_robot under `if __name__ == "__main__":`'
        )
    settings = config if isinstance(config, RobotConfig) else load_robot(_find_config(config))
    substitute = _substitute.get() if port is None else None
    if substitute is not None:
        settings = replace(settings, controller=replace(settings.controller, port="sim"))
        record = substitute.record if record is None else record
        seed = substitute.seed if seed is None else seed
        port = substitute.port(settings, seed)
    if port is None and seed is None and settings.controller.port not in REAL_CONTROLLERS:
        seed = 0  # which the recording says
    opened = open_port(settings, seed=seed or 0) if port is None else port
    # A port that is handed in knows itself whether it is a controller, or wraps one, that waits for nobody.
    real_time = settings.controller.port in REAL_CONTROLLERS if port is None else in_real_time(port)
    with stopped_on_exit(opened.close):
        if record is not None:
            opened = _with_recording(opened, record, settings, seed)
        with stopped_on_exit(opened.close):
            robot = Robot(opened, settings)
            if substitute is not None:
                substitute.robots.append(robot)
            with stopped_on_exit(robot.close), punctual() if real_time else nullcontext():
                try:
                    yield robot
                except TypeError as error:
                    add_unread_hint(error, robot.inputs)
                    raise
                if robot.ticks == 0:  # an action that was made and not run, most likely
                    add_remark(robot, NOTHING_RUN_HINT)


def _find_config(name: str | Path) -> Path:
    """The robot.toml in the folder in which the program was started, else beside the program. Raises
    FileNotFoundError that names both."""
    path = near_program(name)
    if path.is_absolute() or path.exists():
        return path
    started, folder = Path.cwd(), program_folder()
    places = f"in {started} (where the program was started)"
    if folder not in (None, started):
        places += f", and none beside the program in {folder}"
    meant = did_you_mean_file(path) or (folder and did_you_mean_file(folder / path)) or ""
    raise FileNotFoundError(f"there is no {path} {places}{meant}; `raccoon init` writes a template")


def _with_recording(port: Port, path: str | Path, config: RobotConfig, seed: int | None) -> Port:
    """The port wrapped in a recording, if one can be started."""
    import logging

    from raccoon.trace.record import RecordingPort, recording_paths

    recording = RecordingPort(port, path, config=config, seed=seed, needed=False)
    if recording.failure is None and recording.path != recording_paths(path)[1]:
        logging.getLogger("raccoon").warning(
            "the recording %s already exists: this run is written to %s", path, recording.path
        )
    return recording


def open_port(config: RobotConfig, *, seed: int = 0) -> Port:
    """The port that robot.toml's `controller.port` names; the caller closes it. seed: of a simulated one.
    Raises HardwareError if there is no such controller, or another program has it."""
    kind = config.controller.port
    if kind == "sim":
        from raccoon.sim.port import open_simulated

        return open_simulated(config, seed=seed)
    if kind in ("wombat", "wombat-raccoon"):
        from raccoon.hal.wombat.link.spi import SPI_DEVICE
        from raccoon.hal.wombat.port import open_wombat

        controller = config.controller
        return open_wombat(
            kind,
            rate_hz=controller.rate_hz,
            device=controller.device or SPI_DEVICE,
            bemf_rate_hz=controller.counter_rate_hz or None,
            watch_analog=[each.analog for each in config.tophats.values()],
            resting_bemf=all_resting_counts(config),
        )
    if kind == "create":
        from raccoon.hal.create.port import SERIAL_PORT, open_create

        return open_create(config.controller.device or SERIAL_PORT)
    if kind in ("emulator", "emulator-raccoon"):
        from raccoon.robot.emulated import emulated_firmware, open_emulated
        from raccoon.sim.world.table import World

        return open_emulated(config, emulated_firmware(config), seed=seed, world=World.default())
    raise ConfigError(f"controller.port = {kind!r}: there is no such port")


def replay(
    trace: Trace | str | Path,
    program: Action[T] | Callable[[Robot], Action[T] | T],
    *,
    config: RobotConfig | None = None,
    tolerance: float = 0.0,
    check: bool = True,
) -> T:
    """Run `program`, an action or a function of the robot, on a recording of itself and return its result.

    Every command and estimate is compared with the recorded ones. ReplayDiverged names the tick and the field
    of the first difference (tolerance: relative; 0 is exact, 1e-9 suits a recording from another machine).
    After the end of the program nothing moves any more, so a recording in which something does is a
    difference. check=False compares nothing. config: the recording's own if None. The program must depend on
    the robot alone, not on a clock or random numbers. Tophat calibrations that it stores are found by its
    later steps only.
    """
    from raccoon.trace.format import Trace
    from raccoon.trace.replay import ReplayPort

    if not isinstance(trace, Trace | str | Path):
        raise TypeError(f"trace is {trace!r}: it must be the name of a recording, or a Trace")
    check_program(program, "replay()")
    check_number("tolerance", tolerance, "from 0 to below 1")
    port = ReplayPort(trace, check=check, tolerance=tolerance)
    settings = config or port.trace.header.config
    if settings is None:
        raise TraceError("the recording does not contain its robot.toml: pass config=")
    with copy_kept_files(), Robot(port, settings) as robot:
        result = perform(robot, program)
        port.finish()
        return result
