"""A calibrated robot.toml behind another firmware: refused on a controller, understood by the simulator."""

from dataclasses import replace

import pytest

from raccoon import ConfigError, RobotConfig, deg, move, open_robot, straight, wait
from raccoon.core.config import Measured, MechanismConfig, MotorConfig
from raccoon.core.readings import Device
from raccoon.core.sections import ControllerConfig
from raccoon.hal.create.port import CREATE_2
from raccoon.hal.wombat.emulator import Firmware
from raccoon.hal.wombat.firmware.devices import RACCOON_17, RACCOON_21, STOCK
from raccoon.robot.emulated import emulated_firmware, open_emulated
from raccoon.robot.opening import open_port
from raccoon.sim.port import SimPort

DEVICES = pytest.mark.parametrize(
    "device", [STOCK, RACCOON_17, RACCOON_21, CREATE_2], ids=lambda each: each.name
)


def calibrated(device: Device, port: str = "sim") -> RobotConfig:
    """A robot whose motors, unlike by 6 %, were calibrated behind this device."""
    config = RobotConfig(controller=ControllerConfig(port=port), mechanisms={"arm": MechanismConfig(3)})
    nominal = device.position_counts_seconds * device.bemf_volts / config.model.left.back_emf_constant.value
    ticks = {motor: nominal * share for motor, share in ((0, 1.03), (1, 0.97), (3, 1.03))}
    motors = {
        motor: MotorConfig(radians_per_tick=Measured(tick, 0.003 * tick)) for motor, tick in ticks.items()
    }
    return replace(config, motors=motors)


@DEVICES
def test_the_simulated_robot_is_the_calibrated_one(device: Device) -> None:
    config = calibrated(device)
    port = open_port(config)
    assert isinstance(port, SimPort)
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.3))
        robot.run(straight(0.2, 0.15))
        robot.run(move("arm", deg(60.0)))
        assert robot.inputs is not None
        assert robot.inputs.truth is not None
        assert robot.inputs.truth.x == pytest.approx(0.2, abs=0.003)
        assert abs(robot.inputs.truth.y) < 0.005
        assert port.free_motors[3].angle == pytest.approx(deg(60.0), abs=deg(2.5))


@pytest.mark.parametrize(
    ("device", "firmware"), [(RACCOON_17, 21), (RACCOON_21, 17), (RACCOON_17, "stock"), (STOCK, 17)]
)
def test_ticks_of_another_firmware_are_refused_before_anything_moves(
    device: Device, firmware: Firmware
) -> None:
    config = calibrated(device)
    with (
        open_robot(config, port=open_emulated(config, firmware)) as robot,
        pytest.raises(ConfigError, match=r"motor\.0\.radians_per_tick is .* another firmware"),
    ):
        robot.run(straight(0.2))


def test_the_emulated_firmware_is_the_calibrated_one() -> None:
    assert emulated_firmware(calibrated(RACCOON_17, "emulator-raccoon")) == 17
    assert emulated_firmware(calibrated(RACCOON_21, "emulator-raccoon")) == 21
    assert emulated_firmware(RobotConfig(controller=ControllerConfig(port="emulator-raccoon"))) == 21
    assert emulated_firmware(calibrated(STOCK, "emulator")) == "stock"
