"""The same robot in simulators of others: MuJoCo (contacts, friction cones) and WPILib (ideal motors).

Each takes the numbers of our plant and drives with the same duties, so that what differs is the simulator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

GRAVITY = 9.80665


@dataclass(frozen=True)
class Body:
    """What a rigid-body simulator needs to know beyond motor constants. kg, kg m2, m."""

    mass: float = 1.5
    yaw_inertia: float = 0.010
    wheel_inertia: float = 0.0188  # with the rotor, seen from the wheel shaft
    radius: float = 0.0345
    track: float = 0.16

    @property
    def inertia_straight(self) -> float:
        """What one motor feels when both turn alike: half the mass rides on each wheel."""
        return self.wheel_inertia + 0.5 * self.mass * self.radius**2

    @property
    def inertia_turn(self) -> float:
        """... and when they turn against each other: yaw rate is 2 r w / track."""
        return self.wheel_inertia + 2.0 * self.yaw_inertia * (self.radius / self.track) ** 2


@dataclass(frozen=True)
class Motors:
    """Both motors alike, on a stiff battery."""

    voltage: float = 6.8
    resistance: float = 1.8
    back_emf: float = 1.08
    coulomb: float = 0.18
    viscous: float = 0.004


class MujocoRobot:
    """Two driven wheels and a frictionless caster on a plane, tilted by `slope` rad downhill along x."""

    def __init__(self, body: Body, motors: Motors, slope: float = 0.0, step: float = 0.0005) -> None:
        import mujoco

        self._mujoco = mujoco
        self._motors = motors
        self.model = mujoco.MjModel.from_xml_string(_mjcf(body, motors, slope, step))
        self.data = mujoco.MjData(self.model)
        self._steps = round(0.005 / step)
        for _ in range(round(0.2 / step)):  # settle on the floor, held by friction
            mujoco.mj_step(self.model, self.data)
        self._start = self.data.qpos[:2].copy()
        self._turns = 0.0
        self._last = self._yaw()

    def drive(self, left: float, right: float, closed: bool = True) -> None:
        """One controller cycle of 5 ms. closed: whether the windings are connected."""
        motors = self._motors
        gain = motors.back_emf / motors.resistance if closed else 0.0
        self.model.actuator_gainprm[:, 0] = gain
        self.model.actuator_biasprm[:, 2] = -gain * motors.back_emf
        self.data.ctrl[:] = (left * motors.voltage, right * motors.voltage)
        for _ in range(self._steps):
            self._mujoco.mj_step(self.model, self.data)
        yaw = self._yaw()
        self._turns += math.remainder(yaw - self._last, 2 * math.pi)
        self._last = yaw

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y, heading since the start."""
        x, y = self.data.qpos[:2] - self._start
        return float(x), float(y), self._turns

    def _yaw(self) -> float:
        w, x, y, z = self.data.qpos[3:7]
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _mjcf(body: Body, motors: Motors, slope: float, step: float) -> str:
    """Sphere wheels touch the floor in one point each; their mass is a thousandth of the body's."""
    wheel = 0.001 * body.mass
    pull = f"{GRAVITY * math.sin(slope)} 0 {-GRAVITY * math.cos(slope)}"
    spin = body.wheel_inertia - 0.4 * wheel * body.radius**2
    behind = 0.01  # m, so that the caster carries some of the weight
    yaw = body.yaw_inertia - 2 * wheel * (0.5 * body.track) ** 2 - (body.mass - 2 * wheel) * behind**2
    wheels = "".join(
        f"""
        <body pos="0 {side * body.track / 2} 0">
          <joint name="{name}" type="hinge" axis="0 1 0" armature="{spin}"
                 damping="{motors.viscous}" frictionloss="{motors.coulomb}"/>
          <geom type="sphere" size="{body.radius}" mass="{wheel}" friction="1.5 0 0" condim="3"/>
        </body>"""
        for name, side in (("left", 1), ("right", -1))
    )
    return f"""
    <mujoco>
      <option timestep="{step}" gravity="{pull}" cone="elliptic" impratio="100" integrator="implicitfast"/>
      <worldbody>
        <geom type="plane" size="20 20 1" friction="1.5 0 0" condim="3"/>
        <body pos="0 0 {body.radius}">
          <freejoint/>
          <inertial pos="{-behind} 0 -0.01" mass="{body.mass - 2 * wheel}"
                    diaginertia="{0.6 * yaw} {0.6 * yaw} {yaw}"/>
          <geom type="sphere" size="0.01" pos="-0.06 0 {0.01 - body.radius}" mass="0"
                condim="1" priority="1"/>{wheels}
        </body>
      </worldbody>
      <actuator>
        <general joint="left" biastype="affine"/>
        <general joint="right" biastype="affine"/>
      </actuator>
    </mujoco>"""


class WpilibRobot:
    """WPILib's DifferentialDrivetrainSim: ideal motors, no friction, no battery."""

    def __init__(self, body: Body, motors: Motors) -> None:
        from wpilib.simulation import DifferentialDrivetrainSim

        self._voltage = motors.voltage
        self._sim: Any = DifferentialDrivetrainSim(
            dc_motor(motors), 1.0, _yaw_inertia(body), _mass(body), body.radius, body.track
        )

    def drive(self, left: float, right: float) -> None:
        """One controller cycle of 5 ms."""
        self._sim.setInputs(left * self._voltage, right * self._voltage)
        self._sim.update(0.005)

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y, heading (wrapped)."""
        pose = self._sim.getPose()
        return pose.x, pose.y, pose.rotation().radians()


def dc_motor(motors: Motors) -> Any:
    """WPILib's motor with our constants: it takes stall and free-running figures."""
    from wpimath.system.plant import DCMotor

    stall_current = motors.voltage / motors.resistance
    return DCMotor(
        motors.voltage,
        motors.back_emf * stall_current,
        stall_current,
        0.0,
        motors.voltage / motors.back_emf,
        1,
    )


def _mass(body: Body) -> float:
    """All inertia that both motors feel alike, as mass: WPILib's robot has no wheel inertia."""
    return 2.0 * body.inertia_straight / body.radius**2


def _yaw_inertia(body: Body) -> float:
    return 0.5 * body.inertia_turn * (body.track / body.radius) ** 2
