"""The simulated robot as a program meets it."""

from itertools import pairwise
from statistics import stdev
from typing import Any

import pytest

from raccoon.core.config import DriveConfig, MechanismConfig, MotorConfig, RobotConfig, TophatConfig
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Outputs
from raccoon.core.schema import Measured
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World


def sim(config: RobotConfig | None = None, **options: Any) -> SimPort:
    return SimPort(Parameters.from_robot(config or RobotConfig()), World.empty(), **options)


def drive(port: SimPort, duty: tuple[float, float], cycles: int) -> Inputs:
    port.write(Outputs(duty=(*duty, 0.0, 0.0)))
    return [port.read() for _ in range(cycles)][-1]


def test_it_is_a_port_that_starts_at_time_zero_at_rest() -> None:
    port: Port = sim(noise=False)
    first = port.read()
    assert first.time == 0.0
    assert [port.read().time for _ in range(3)] == [0.005, 0.01, 0.015]
    assert list(first.bemf) == [0, 0, 0, 0]
    assert first.truth is not None
    assert (first.truth.x, first.truth.y, first.truth.heading) == (0.0, 0.0, 0.0)


def test_words_are_whole_numbers() -> None:
    port = sim(RobotConfig(tophats={"front": TophatConfig(analog=2)}))
    inputs = drive(port, (0.5, 0.4), 100)
    assert inputs.gyro is not None
    assert inputs.accel is not None
    words = (*inputs.bemf, *inputs.position, *inputs.gyro, *inputs.accel, *inputs.analog, inputs.battery)
    assert all(isinstance(word, int) for word in words)


def test_a_model_of_another_robot_is_wired_as_the_one_that_drives_it() -> None:
    own = RobotConfig(drive=DriveConfig(2, 3), motors={3: MotorConfig(inverted=True)})
    model = RobotConfig(motors={1: MotorConfig(bemf_offset=Measured(30.0))})
    port = SimPort(Parameters.from_robot(model), World.empty(), robot=own, noise=False)
    inputs = port.read()
    assert list(inputs.bemf) == [0, 0, 0, 30]  # as the board has it
    port.write(Outputs(duty=(0.0, 0.0, 0.5, -0.5)))
    for _ in range(100):
        inputs = port.read()
    assert inputs.truth is not None
    assert inputs.truth.x > 0.02
    assert inputs.truth.heading == 0.0
    assert inputs.position[:2] == (0, 0)
    assert (inputs.position[2] or 0) > 0 > (inputs.position[3] or 0)


def test_half_duty_reaches_the_steady_speed_of_the_textbook() -> None:
    # w = (K U / R - T) / (K^2 / R + B), U = 6.8 / 2 less the sag of two half-driven motors.
    port = sim(noise=False)
    inputs = drive(port, (0.5, 0.5), 400)
    k, r, coulomb, viscous, sag = 1.08, 1.8, 0.18, 0.004, 0.05
    current = 0.0
    for _ in range(50):
        voltage = 0.5 * (6.8 - sag * 2 * 0.5 * current)
        speed = (k * voltage / r - coulomb) / (k * k / r + viscous)
        current = (voltage - k * speed) / r
    counts = k * speed / inputs.device.bemf_volts
    assert inputs.bemf[0] == pytest.approx(counts, abs=1.0)
    assert inputs.bemf[0] == inputs.bemf[1]


def test_an_inverted_motor_turns_the_wheel_backwards_on_positive_duty() -> None:
    port = sim(RobotConfig(motors={1: MotorConfig(inverted=True)}), noise=False)
    inputs = drive(port, (0.5, -0.5), 200)
    assert inputs.truth is not None
    assert inputs.truth.x > 0.09
    assert inputs.truth.heading == pytest.approx(0.0, abs=1e-9)
    assert inputs.bemf[1] == -float(inputs.bemf[0] or 0)
    assert inputs.position[1] == -float(inputs.position[0] or 0)


def test_the_faster_right_wheel_turns_it_left() -> None:
    inputs = drive(sim(noise=False), (0.3, 0.6), 100)
    assert inputs.truth is not None
    assert inputs.truth.heading > 0.0
    assert inputs.truth.y > 0.0
    assert (inputs.turn_rate or 0.0) > 0.0


def test_the_same_seed_gives_the_same_run_and_another_seed_another() -> None:
    runs = [[drive(sim(seed=seed), (0.5, 0.5), each) for each in range(1, 20)] for seed in (3, 3, 4)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


@pytest.mark.parametrize("rate_hz", [20.0, 133.0, 200.0, 300.0, 500.0])
def test_the_lag_that_is_told_is_that_of_the_counters_at_any_rate(rate_hz: float) -> None:
    port = SimPort(Parameters.from_robot(RobotConfig()), World.empty(), rate_hz=rate_hz, noise=False)
    inputs = drive(port, (0.6, 0.6), round(rate_hz))
    bemf, position, lag = inputs.bemf[0], inputs.position[0], inputs.device.bemf_lag
    assert inputs.truth is not None
    assert bemf is not None
    assert position is not None
    assert lag is not None
    constant = RobotConfig().model.left.back_emf_constant.value
    turned = inputs.truth.x / RobotConfig().model.drive.wheel_radius.value
    counted = turned * constant / inputs.device.bemf_volts
    assert position + lag * bemf == pytest.approx(counted, abs=1.5)  # a tick, and counts cut off


def test_each_cycle_of_the_controller_has_noise_of_its_own() -> None:
    """At 80 Hz a period is two and a half of its cycles, for which three are taken."""
    loud = Noise(bemf=6000.0, gyro=0.0, gyro_bias=0.0, accel=0.0, battery=0.0, analog=0.0)
    parameters = Parameters.from_robot(RobotConfig()).with_effect("bemf.filter_lag", time_constant=0.0)
    port = SimPort(parameters, World.empty(), rate_hz=80.0, noise=loud)
    counts = [port.read().position[0] or 0.0 for _ in range(800)]
    steps = [after - before for before, after in pairwise(counts)]
    assert stdev(steps) == pytest.approx(6000.0 * 0.0125 / 3**0.5, rel=0.1)


def test_an_arm_gets_the_voltage_that_is_there_and_not_the_one_that_is_reported() -> None:
    """The wheels' load is over; a filter that holds still reports it."""
    config = RobotConfig(mechanisms={"arm": MechanismConfig(motor=2)})
    speeds = []
    for chain in (Chain(), Chain(battery_held=0.5)):
        port = SimPort(Parameters.from_robot(config).with_chain(chain), noise=False)
        drive(port, (1.0, 1.0), 10)
        port.write(Outputs(duty=(0.0, 0.0, 1.0, 0.0)))
        for _ in range(60):
            port.read()
        speeds.append(port.free_motors[2].speed)
    assert speeds[1] == pytest.approx(speeds[0], rel=1e-6)


def test_it_takes_no_commands_after_close_and_closes_twice() -> None:
    port = sim()
    port.close()
    port.close()
    with pytest.raises(HardwareError, match="closed"):
        port.write(Outputs())
    with pytest.raises(HardwareError, match="closed"):
        port.read()


@pytest.mark.parametrize(("name", "value"), [("rate_hz", 0.0), ("imu_rate_hz", -1.0), ("physics_step", 0.1)])
def test_impossible_options_are_named(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=name):
        sim(RobotConfig(), **{name: value})


def test_a_slow_imu_says_nothing_between_its_readings() -> None:
    port = sim(imu_rate_hz=50.0)
    news = [drive(port, (0.2, 0.2), 1).gyro is not None for _ in range(40)]
    assert sum(news) == 10
