"""The simulated robot behind a port: commands down, raw words up, one controller cycle a read."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.readings import (
    MOTOR_PORTS,
    SIMULATOR,
    STOP,
    Device,
    Inputs,
    Outputs,
    Truth,
    Words,
)
from raccoon.model.bemf import counter_lag
from raccoon.sim.bystander import SimulatedBystander
from raccoon.sim.effects.calibrated import calibrated_robot, simulated_device
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.parameters import SIDES, Parameters
from raccoon.sim.effects.physical import gyro_lag, plant_numbers, safe_step, sample_slots, wiring_signs
from raccoon.sim.plant.driver import cycle_count
from raccoon.sim.plant.free_motor import FreeMotor
from raccoon.sim.plant.quantities import State
from raccoon.sim.plant.sensing import period_of
from raccoon.sim.robot import SimulatedRobot, bridge_commands
from raccoon.sim.tophats import Tophat
from raccoon.sim.words import AnalogConverter, Imu, NormalNumbers
from raccoon.sim.world.bumpers import Bumpers
from raccoon.sim.world.table import World


class SimPort:
    """A Port whose robot is the plant; its counters count in the ticks of `robot` (`effects.calibrated`).

    A read lets one period pass under the last written command; the first one shows the robot at time 0, at
    rest. `write` and `read` after `close` raise HardwareError.

    parameters: the plant. world: by default the Botball-size table. robot: whose ports, wiring and sensors
    the words are for, by default that of the parameters. start: pose in the world (m, m, rad). truth: whether
    Inputs.truth says where the robot is. noise: False for sensors that scatter by nothing, or how much.
    imu_rate_hz: how often a new IMU reading comes. physics_step: s, no step of the plant is longer.
    The same seed gives the same run.
    """

    def __init__(
        self,
        parameters: Parameters,
        world: World | None = None,
        *,
        robot: RobotConfig | None = None,
        seed: int = 0,
        rate_hz: float = 200.0,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        truth: bool = True,
        noise: bool | Noise = True,
        imu_rate_hz: float = 200.0,
        physics_step: float = 0.0025,
    ) -> None:
        _check("rate_hz", rate_hz, 10.0, 1000.0)
        _check("imu_rate_hz", imu_rate_hz, 1.0, 1000.0)
        _check("physics_step", physics_step, 1e-5, 0.005)
        if not all(math.isfinite(each) for each in start):
            raise ConfigError(f"start is {start}: allowed are finite numbers")
        config = robot or parameters.robot
        parameters = _wired(parameters, config)
        self._world = World.default() if world is None else world
        self._noise = noise if isinstance(noise, Noise) else Noise() if noise else Noise.none()
        self._scatter = NormalNumbers(np.random.default_rng(seed))
        lag = float(gyro_lag(np.array(parameters.value("imu.latency", "seconds")), 1.0 / rate_hz))
        plant = plant_numbers(parameters)._replace(gyro_lag=lag)
        self._robot = SimulatedRobot(
            plant,
            self._world,
            period=1.0 / rate_hz,
            cycle=parameters.chain.cycle,
            slots=sample_slots(parameters),
            longest_step=min(physics_step, safe_step(np.array([plant]))),
            start=start,
            body=parameters.robot.body,
        )
        self._ports = config.drive.left, config.drive.right
        self._signs = wiring_signs(parameters)
        device = simulated_device(config)
        self.free_motors = {
            each.motor: FreeMotor(config, each.motor, each.inertia, device, each.stops)
            for each in config.mechanisms.values()
        }
        """The motors of the mechanisms by port."""
        self._bumpers = Bumpers(config.bumpers.values(), self._world, parameters.robot.body)
        self._imu = Imu(parameters, self._noise, self._scatter, imu_rate_hz, lag)
        tophats = [Tophat(each, parameters) for each in config.tophats.values()]
        self.bystander = SimulatedBystander()
        self._converter = AnalogConverter(tophats, self._noise, self._scatter, self.bystander)
        self._cycles = cycle_count(1.0 / rate_hz, parameters.chain.cycle)
        self._truth = truth
        self._tick = device.position_counts_seconds
        self._device = _with_chain(device, config, parameters.chain, 1.0 / rate_hz)
        self._outputs = STOP
        self._rate_hz = rate_hz
        self._cycle = -1
        self._closed = False
        self.button: bool | None = None
        """Whether the controller's button is pressed, whoever stands by; None where that is as they do."""

    def read(self) -> Inputs:
        """The next cycle. Raises HardwareError after close."""
        if self._closed:
            raise HardwareError("the simulated robot is closed")
        if self._cycle >= 0:
            duty, closed = bridge_commands(self._outputs, self._ports, self._signs)
            self._robot.step(duty, closed, self._bemf_noise())
            for port, motor in self.free_motors.items():
                held = self._outputs.brake[port] or self._outputs.duty[port] != 0.0
                given = self._outputs.duty[port] if held else None
                motor.step(given, self._robot.state.bus, 1.0 / self._rate_hz)
        self._cycle += 1
        return self._inputs()

    def write(self, outputs: Outputs) -> None:
        """Command motors until the next write. Raises HardwareError after close."""
        if self._closed:
            raise HardwareError("the simulated robot is closed: it takes no commands")
        self._outputs = outputs

    def close(self) -> None:
        """Motors off."""
        self._outputs = STOP
        self._closed = True

    def _bemf_noise(self) -> list[list[float]]:
        sd, draw = self._noise.bemf, self._scatter.next
        return [[sd * draw() for _ in range(self._cycles)] for _ in range(2)]

    def _inputs(self) -> Inputs:
        state = self._robot.state
        pose = self._robot.pose
        self.bystander.time = state.time
        heading = math.cos(pose[2]), math.sin(pose[2])
        analog, surface = self._converter.analog(self._world, pose, heading, state.time)
        imu = self._imu.read(state, self._robot.tilt)
        bemf, position = self._motor_words(state)
        button = self.bystander.button if self.button is None else self.button
        return Inputs(
            time=self._cycle / self._rate_hz,
            device=self._device,
            bemf=bemf,
            position=position,
            gyro=imu[0] if imu else None,
            accel=imu[1] if imu else None,
            analog=analog,
            digital=self._bumpers.digital(pose),
            battery=self._converter.battery(state.battery),
            truth=Truth(*pose, surface) if self._truth else None,
            extra=None if button is None else {"button": float(button)},
        )

    def _motor_words(self, state: State) -> tuple[Words, Words]:
        """Back-EMF counts and counter ticks of every port."""
        left, right = self._ports
        bemf: list[float | None] = [0] * MOTOR_PORTS
        position: list[float | None] = [0] * MOTOR_PORTS
        bemf[left], position[left] = (
            int(self._signs[0] * state.bemf_left),
            int(self._signs[0] * state.position_left / self._tick),
        )
        bemf[right], position[right] = (
            int(self._signs[1] * state.bemf_right),
            int(self._signs[1] * state.position_right / self._tick),
        )
        for port, motor in self.free_motors.items():
            bemf[port], counted = motor.words
            position[port] = int(counted / self._tick)
        return tuple(bemf), tuple(position)


def open_simulated(
    config: RobotConfig,
    *,
    seed: int = 0,
    world: World | None = None,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    robot: Parameters | None = None,
) -> SimPort:
    """The simulated robot of a robot.toml.

    robot: the plant, by default that with the motors that `config` has calibrated; the rest as of `SimPort`.
    """
    if robot is None:
        robot = calibrated_robot(config, simulated_device(config))
    return SimPort(robot, world, robot=config, seed=seed, rate_hz=config.controller.rate_hz, start=start)


def _wired(parameters: Parameters, config: RobotConfig) -> Parameters:
    """The robot of these parameters on the ports of `config`, with its wiring and its sensors."""
    own = parameters.robot
    wheels = {
        getattr(config.drive, side): replace(
            own.wheel_motor(side), inverted=config.wheel_motor(side).inverted
        )
        for side in SIDES
    }
    robot = replace(config, motors={**config.motors, **wheels}, body=own.body, model=own.model)
    return replace(parameters, robot=robot)


def _with_chain(device: Device, config: RobotConfig, chain: Chain, period: float) -> Device:
    """The words as this chain makes them in rows of `period` s: how late back-EMF is, by its filter, and how
    long its samples take."""
    cycle = period / cycle_count(period, chain.cycle)
    counted = period_of(cycle, chain.cycle)
    return replace(
        device,
        name=SIMULATOR.name if chain == Chain() else f"{SIMULATOR.name}-chain",
        bemf_lag=counter_lag(config.model.bemf.filter_time_constant.value, counted) * (cycle / counted),
        driven_share=1.0 - chain.coast_share,
    )


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ConfigError(f"{name} is {value}: allowed are numbers from {low} to {high}")
