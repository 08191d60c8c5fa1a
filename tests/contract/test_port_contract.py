"""What every port promises, whatever is behind it."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from bench_robot import BenchRobot
from raccoon.core.clock import SteppedClock
from raccoon.core.config import RobotConfig
from raccoon.core.errors import RaccoonError
from raccoon.core.port import Port
from raccoon.core.readings import (
    ANALOG_PORTS,
    DIGITAL_PORTS,
    MOTOR_PORTS,
    STOP,
    Device,
    Inputs,
    Outputs,
)
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.trace.record import RecordingPort
from raccoon.trace.replay import ReplayPort

CYCLES = 60
FORWARD = Outputs(duty=(0.6, 0.6, 0.0, 0.0))


def wombat(firmware: Firmware) -> WombatPort:
    clock = SteppedClock()
    return WombatPort(Emulator(BenchRobot(), firmware, clock=clock), clock=clock)


def simulated() -> SimPort:
    return SimPort(Parameters.from_robot(RobotConfig()))


def recording(folder: Path) -> RecordingPort:
    return RecordingPort(wombat("stock"), folder / "run")


def replaying(folder: Path) -> ReplayPort:
    port = recording(folder)
    for _ in range(CYCLES + 1):
        port.read()
        port.write(FORWARD)
    port.close()
    return ReplayPort(port.path, check=False)


MAKERS: dict[str, Callable[[Path], Port]] = {
    "wombat-stock": lambda _: wombat("stock"),
    "wombat-raccoon-17": lambda _: wombat(17),
    "wombat-raccoon-21": lambda _: wombat(21),
    "simulator": lambda _: simulated(),
    "recording": recording,
    "replay": replaying,
}


@pytest.fixture(params=MAKERS)
def port(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Port]:
    made = MAKERS[request.param](tmp_path)
    yield made
    made.close()


def run(port: Port, cycles: int = CYCLES, outputs: Outputs = FORWARD) -> list[Inputs]:
    seen = []
    for _ in range(cycles):
        seen.append(port.read())
        port.write(outputs)
    return seen


def test_it_is_a_port(port: Port) -> None:
    assert isinstance(port, Port)


def test_time_goes_forward(port: Port) -> None:
    times = [each.time for each in run(port)]
    assert all(later > earlier for earlier, later in pairwise(times))


def test_every_cycle_has_a_word_or_none_for_each_port(port: Port) -> None:
    for inputs in run(port):
        assert len(inputs.bemf) == len(inputs.position) == MOTOR_PORTS
        assert len(inputs.analog) == ANALOG_PORTS
        assert len(inputs.digital) == DIGITAL_PORTS
        assert isinstance(inputs.device, Device)


def test_positive_duty_counts_up(port: Port) -> None:
    last = run(port)[-1]
    for side in (0, 1):
        assert (last.bemf[side] or 0.0) > 100.0
        assert (last.position[side] or 0.0) > 0.0


def test_a_robot_that_stands_feels_gravity_upwards(port: Port) -> None:
    felt = [each.accel[2] * each.device.accel_m_s2 for each in run(port, outputs=STOP) if each.accel]
    assert felt
    assert felt[0] == pytest.approx(9.81, abs=0.5)


def test_closing_twice_is_fine(port: Port) -> None:
    run(port, 5)
    port.close()
    port.close()


@pytest.mark.parametrize("name", [name for name in MAKERS if name != "replay"])
def test_a_closed_port_refuses_commands(name: str, tmp_path: Path) -> None:
    """All but a replay, which has no device to lose."""
    port = MAKERS[name](tmp_path)
    run(port, 5)
    port.close()
    with pytest.raises(RaccoonError):
        port.write(STOP)
    with pytest.raises(RaccoonError):
        port.read()


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_closing_stops_the_motors(firmware: Firmware) -> None:
    clock = SteppedClock()
    emulator = Emulator(BenchRobot(), firmware, clock=clock)
    port = WombatPort(emulator, clock=clock)
    run(port, 20)
    assert emulator.motors_running
    port.close()
    clock.advance(0.05)
    emulator.run()
    assert not emulator.motors_running
