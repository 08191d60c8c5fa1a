"""The simulated robot behind an emulated Wombat: the same bytes, checks and faults as on the real bus."""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.core.clock import SteppedClock
from raccoon.core.config import RobotConfig
from raccoon.core.readings import ANALOG_PORTS, MOTOR_PORTS, SIMULATOR, Device
from raccoon.estimate.drive.wheels import all_resting_counts
from raccoon.hal.wombat.emulator import Drive, Emulator, Firmware, PlantState
from raccoon.hal.wombat.firmware.devices import RACCOON_17, RACCOON_21, STOCK
from raccoon.hal.wombat.port import WombatPort
from raccoon.model.imu import specific_force
from raccoon.sim.bystander import SimulatedBystander
from raccoon.sim.effects.calibrated import calibrated_robot, simulated_device
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, state_at_rest, wiring_signs
from raccoon.sim.plant.free_motor import FreeMotor
from raccoon.sim.plant.quantities import Plant
from raccoon.sim.plant.stepped import Steps
from raccoon.sim.tophats import Tophat
from raccoon.sim.world.bumpers import Bumpers
from raccoon.sim.world.contact import NO_SLIP, Contact, with_pose
from raccoon.sim.world.table import World

LONGEST_STEP_S = 0.0025
"""s; the plant's own step, see docs/simulator.md."""
DEVICES: dict[Firmware, Device] = {"stock": STOCK, 17: RACCOON_17, 21: RACCOON_21}
FLOATING = 2000.0
"""Counts on an analog port with nothing plugged in."""


class SimulatedPlant:
    """The simulated robot as the motors and sensors of an emulated controller.

    Everything up to the terminals and pins comes from the simulator; sampling, filters and coasting windows
    are the emulated firmware's, so the plant's own are switched off. `latency` is not simulated: the emulator
    has its own. world: its table, with walls, objects and ramps; None means the usual table's lines on an
    endless floor. device: the one whose counters robot.toml's mechanisms are calibrated with.
    """

    def __init__(
        self, parameters: Parameters, world: World | None = None, device: Device = SIMULATOR
    ) -> None:
        robot = parameters.robot
        self._numbers = _without_controller(parameters)
        self._ports = robot.drive.left, robot.drive.right
        self._signs = wiring_signs(parameters)
        self._world = replace(World.default(), walls=()) if world is None else world
        self._tophats = [Tophat(each, parameters) for each in robot.tophats.values()]
        self._bumpers = Bumpers(robot.bumpers.values(), self._world, robot.body)
        self._state = state_at_rest(self._numbers)
        self._steps = Steps()
        self._contact = Contact(self._world, robot.body, self._numbers, LONGEST_STEP_S, (0.0, 0.0, 0.0))
        self.free_motors = {
            each.motor: FreeMotor(robot, each.motor, each.inertia, device, each.stops)
            for each in robot.mechanisms.values()
        }
        """The motors of the mechanisms by port."""
        self.button = False
        """Whether the controller's button is pressed by anyone but the bystander."""
        self.bystander = SimulatedBystander()

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y in m and heading in rad, in the world."""
        return self._state.x, self._state.y, self._state.heading

    def become(self, parameters: Parameters) -> None:
        """Continue as another robot from this place at this speed: another battery, another load. The wiring
        stays."""
        self._numbers = _without_controller(parameters)
        self._contact.set_robot(self._numbers)

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        """Advance the time with the motors driven like this."""
        before = self._state.forward_speed + self._contact.slip.forward
        left, right = drives[self._ports[0]], drives[self._ports[1]]
        left = None if left is None else self._signs[0] * left
        right = None if right is None else self._signs[1] * right
        steps = math.ceil(seconds / LONGEST_STEP_S)
        for _ in range(steps):
            step = seconds / steps
            self._state = self._steps.after(self._state, self._numbers, step, left, right)
            self._apply_contact(step)
        for port, motor in self.free_motors.items():
            motor.step(drives[port], self._state.bus, seconds)
        return self._imu_words(before, seconds)

    def _apply_contact(self, seconds: float) -> None:
        s = self._state
        x, y, heading = self._contact.resolve((s.x, s.y, s.heading), seconds)
        if self._contact.slip is not NO_SLIP:
            self._state = with_pose(s, x, y, heading)
        self._numbers = self._contact.with_loads(self._numbers, x, y)

    def _imu_words(self, before: float, seconds: float) -> PlantState:
        """What the firmware samples: terminals, IMU, pins. before: forward speed (m/s) `seconds` s ago."""
        self.bystander.time = self._state.time
        s, p, slip = self._state, self._numbers, self._contact.slip
        speed, turn_rate = s.forward_speed + slip.forward, s.yaw_rate + slip.turning
        change = (speed - before) / seconds if seconds > 0.0 else 0.0
        lean, pitch_rate = self._contact.tilt(self.pose, seconds)
        volts = [0.0] * MOTOR_PORTS
        volts[self._ports[0]] = self._signs[0] * p.back_emf_left * s.speed_left
        volts[self._ports[1]] = self._signs[1] * p.back_emf_right * s.speed_right
        for port, motor in self.free_motors.items():
            volts[port] = motor.back_emf
        return PlantState(
            bemf_volts=tuple(volts),
            battery_voltage=s.bus,
            gyro=(0.0, pitch_rate, turn_rate),
            accel=specific_force(change, speed, turn_rate, lean),
            analog=self._analog(),
            digital=self._bumpers.digital(self.pose),
            button=self.button or self.bystander.button is True,
        )

    def _analog(self) -> tuple[float, ...]:
        s = self._state
        counts = [FLOATING] * ANALOG_PORTS
        for tophat in self._tophats:
            counts[tophat.port], _ = tophat.read(self._world, s.x, s.y, s.heading_cos, s.heading_sin, s.time)
            if self.bystander.black is not None:
                counts[tophat.port] = tophat.over(self.bystander.black)
        for port, lit in self.bystander.lit().items():
            counts[port] = lit
        return tuple(counts)


def _without_controller(parameters: Parameters) -> Plant:
    """The plant's numbers without what the emulated firmware does itself."""
    return plant_numbers(parameters)._replace(latency=0.0, closed_share=1.0)


def open_emulated(
    config: RobotConfig,
    firmware: Firmware = "stock",
    *,
    seed: int = 0,
    world: World | None = None,
    robot: Parameters | None = None,
) -> WombatPort:
    """An emulated Wombat with the simulated robot on it, as fast as the computer allows (its clock is
    stepped).

    firmware: "stock", 17 or 21. world: see `SimulatedPlant`. robot: the simulated robot, which may differ
    from `config`; by default `config`'s, with the motors that were calibrated behind this firmware.
    """
    clock = SteppedClock()
    device = DEVICES[firmware]
    plant = SimulatedPlant(calibrated_robot(config, device) if robot is None else robot, world, device)
    link = Emulator(plant, firmware, clock=clock, seed=seed)
    port = WombatPort(
        link,
        clock=clock,
        rate_hz=config.controller.rate_hz,
        reset_line=link,
        watch_analog=[each.analog for each in config.tophats.values()],
        resting_bemf=all_resting_counts(config),
    )
    port.bystander = plant.bystander
    return port


def emulated_firmware(config: RobotConfig) -> Firmware:
    """The firmware that `controller.port` means; of the two RaccoonOS versions, the one whose ticks
    robot.toml has."""
    if config.controller.port == "emulator":
        return "stock"
    ticks = simulated_device(config).position_counts_seconds
    return 17 if ticks < math.sqrt(RACCOON_17.position_counts_seconds) else 21
