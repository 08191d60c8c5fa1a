"""The simulated robot as a Port: takes commands, gives raw words, one controller cycle per read."""

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
    """A Port whose robot is simulated by the plant. Its position counters count in the ticks for which
    `robot` is calibrated (`effects.calibrated`).

    Each read advances the simulation by one period (1 / rate_hz) under the last written command; the first
    read gives the robot at time 0, at rest. `write` and `read` after `close` raise HardwareError.

    parameters: the simulated robot. world: its table, by default the one of Botball size. robot: the
    robot.toml whose ports, wiring and sensors the words are made for, by default that of the parameters.
    start: pose in the world (m, m, rad). truth: whether Inputs.truth contains the true pose. noise: False for
    sensors without noise, or a `Noise` with its standard deviations. imu_rate_hz: rate of new IMU readings.
    physics_step: longest step of the plant, s. The same seed gives the same run. Raises ConfigError for rates
    and steps out of range and a start that is not finite.
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
        """The motors of the mechanisms, by motor port."""
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
        """Whether the controller's button is pressed, overriding the simulated bystander; None: the bystander
        decides."""

    def read(self) -> Inputs:
        """Advance by one period and return the readings. Raises HardwareError after close."""
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
        """Command the motors until the next write. Raises HardwareError after close."""
        if self._closed:
            raise HardwareError("the simulated robot is closed: it takes no commands")
        self._outputs = outputs

    def close(self) -> None:
        """Turn the motors off and end the simulation."""
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
        """Back-EMF, counts, and position, ticks, of every motor port."""
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
    """The simulated robot of a robot.toml, as a port.

    robot: the parameters of the plant, by default those with the K_E that the calibration in `config`
    implies. The other arguments are as in `SimPort`. Raises ConfigError as `SimPort` does.
    """
    if robot is None:
        robot = calibrated_robot(config, simulated_device(config))
    return SimPort(robot, world, robot=config, seed=seed, rate_hz=config.controller.rate_hz, start=start)


def _wired(parameters: Parameters, config: RobotConfig) -> Parameters:
    """These parameters with the ports, wiring and sensors of `config`; the motors' constants, body and model
    stay their own."""
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
    """The device with the properties of this chain in rows of `period` s: the lag of back-EMF in its filter,
    s, and the share of the time in which the motors are driven."""
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
