"""The plant against simulators that others wrote, on the same manoeuvres with the same constants."""

import math

import numpy as np
import pytest

from peer_manoeuvres import BODY, MANOEUVRES, ONES, ROWS, TIME, our_end, robot
from peer_robots import Motors, MujocoRobot, WpilibRobot, dc_motor
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout


@pytest.mark.parametrize("name", MANOEUVRES)
def test_mujoco_ends_within_a_percent_and_a_degree(name: str) -> None:
    pytest.importorskip("mujoco")
    left, right, brake, slope = MANOEUVRES[name]
    peer = MujocoRobot(BODY, Motors(), slope)
    for row in range(ROWS - 1):
        peer.drive(left[row], right[row], closed=brake or left[row] != 0.0)
    ours, way = our_end(Motors(), left, right, brake, slope)
    assert math.dist(ours[:2], peer.pose[:2]) <= 0.01 * way
    assert abs(ours[2] - peer.pose[2]) <= math.radians(1.0)


@pytest.mark.parametrize("name", ["straight", "turn", "arc"])
def test_wpilib_agrees_where_motors_are_ideal(name: str) -> None:
    pytest.importorskip("wpilib.simulation")
    ideal = Motors(coulomb=0.0, viscous=0.0)
    left, right, brake, _ = MANOEUVRES[name]
    peer = WpilibRobot(BODY, ideal)
    for row in range(ROWS - 1):
        peer.drive(left[row], right[row])
    ours, _ = our_end(ideal, left, right, brake)
    np.testing.assert_allclose(ours, peer.pose, atol=1e-10)


def test_wpilib_motor_on_its_way_to_speed() -> None:
    simulation = pytest.importorskip("wpilib.simulation")
    plant = pytest.importorskip("wpimath.system.plant")
    ideal = Motors(coulomb=0.0, viscous=0.0)
    motor = dc_motor(ideal)
    peer = simulation.DCMotorSim(plant.LinearSystemId.DCMotorSystem(motor, BODY.inertia_straight, 1.0), motor)
    duty = 4.0 / ideal.voltage * ONES
    run = rollout(robot(ideal), Commands.of_wheels(TIME, duty, duty), longest_step=0.001)
    theirs = [0.0]
    for _ in range(60):
        peer.setInputVoltage(4.0)
        peer.update(0.005)
        theirs.append(peer.getAngularVelocity())
    np.testing.assert_allclose(run["motor.0.speed"][0, :61], theirs, atol=2e-4)
