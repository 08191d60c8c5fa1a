"""Identifies the firmware of a recording that does not name it, by robot.toml or the command line.

A CSV of one's own logger does not name the controller. Its user knows that it is a Wombat, and no reading
shows how long its motors pause for samples: with the stock firmware that looks like a resistance 28 % too
high.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.rollout.firmware import firmware_of
from raccoon.hal.wombat.firmware.devices import RACCOON_17, RACCOON_21, STOCK

Columns = Mapping[str, NDArray[np.float64]]

STOCK_PORT, RACCOON_PORT = "wombat", "wombat-raccoon"
FIRMWARE_PORTS = (STOCK_PORT, RACCOON_PORT)
"""Values of robot.toml's controller.port that name a firmware."""
BY_PORT_NOTE = 'its firmware is named by controller.port = "{}" (robot.toml, or --port), not by the recording'
MIN_ZONE_NEIGHBOURS = 20
"""Least number of readings just above a dead zone for the conclusion that readings inside are missing."""
MAX_MISSING_RATIO, MIN_PRESENT_RATIO = 0.35, 0.6
"""Ratio of the readings below 9 counts to those from 10 to 20: up to the first threshold the firmware has a
dead zone, above the second it has none. A wheel that comes to rest has as many of either. (At rest, which is
most readings, a dead zone reads 0 and nothing else; with an offset it never does.)"""
MIN_MIDDLE_RATIO = 0.1
"""Least ratio of the readings from 10 to 20 counts to those from 25 to 50 if the former are not in a dead
zone."""


class DeadZone(Enum):
    """Dead zone of back-EMF by its smallest readings: the counts below which it reads 0."""

    UNKNOWN = ""
    NONE = "none"
    STOCK = "10 counts"
    RACCOON_21 = "25 counts"


def detect_dead_zone(columns: Columns, robot: RobotConfig) -> DeadZone:
    """The dead zone of both wheels' readings, if it is that of a Wombat firmware."""
    names = [f"motor.{port}.bemf" for port in (robot.drive.left, robot.drive.right)]
    if not all(name in columns for name in names):
        return DeadZone.UNKNOWN
    sizes = np.abs(np.concatenate([columns[name] for name in names]))
    sizes = sizes[np.isfinite(sizes)]

    def count_between(low: float, high: float) -> int:
        return int(((sizes >= low) & (sizes < high)).sum())

    rests, small, middle, large = (
        count_between(0.0, 0.5),
        count_between(0.5, 9.0),
        count_between(10.0, 20.0),
        count_between(25.0, 50.0),
    )
    if middle >= MIN_ZONE_NEIGHBOURS and small > MIN_PRESENT_RATIO * middle:
        return DeadZone.NONE
    if middle >= max(MIN_ZONE_NEIGHBOURS, MIN_MIDDLE_RATIO * large):
        return DeadZone.STOCK if rests >= middle and small < MAX_MISSING_RATIO * middle else DeadZone.UNKNOWN
    nothing = small + count_between(9.0, 24.0) < MIN_MIDDLE_RATIO * large
    return DeadZone.RACCOON_21 if rests >= large >= MIN_ZONE_NEIGHBOURS and nothing else DeadZone.UNKNOWN


@dataclass(frozen=True, slots=True)
class FirmwareIdentity:
    """Identity of the device that made a recording. device: with its firmware, if known. is_external: whether
    the firmware is known from outside the recording, whose units are then not certain. notes: on the
    identification. candidate: the identity with a firmware that nobody named, but whose dead zone the
    readings have."""

    device: Device
    is_external: bool = False
    notes: tuple[str, ...] = ()
    candidate: FirmwareIdentity | None = None


def identify_firmware(
    device: Device, columns: Columns, robot: RobotConfig, port: str | None
) -> FirmwareIdentity:
    """Identify the device of a drive's columns. port: controller.port of robot.toml or of the command line,
    None without one; a firmware that the recording names takes precedence."""
    if firmware_of(device) is not None or device.name != SI_WORDS.name:
        return FirmwareIdentity(device, notes=_contradiction_notes(device, port))
    zone = detect_dead_zone(columns, robot)
    if port not in FIRMWARE_PORTS:
        return _identity_with_candidate(device, zone)
    zones_by_port = {
        STOCK_PORT: (DeadZone.STOCK, DeadZone.UNKNOWN),
        RACCOON_PORT: (DeadZone.RACCOON_21, DeadZone.NONE, DeadZone.UNKNOWN),
    }
    if zone not in zones_by_port[port]:
        expected = DeadZone.STOCK if port == STOCK_PORT else DeadZone.RACCOON_21
        smaller = "there are smaller readings"
        evidence = smaller if zone is DeadZone.NONE else f"all readings below {zone.value} are 0"
        unused = (
            f'controller.port = "{port}" is not used: that firmware reads back-EMF below {expected.value} as '
            f"0, but here {evidence}"
        )
        return FirmwareIdentity(device, notes=(unused,))
    firmware = STOCK if port == STOCK_PORT else RACCOON_21 if zone is DeadZone.RACCOON_21 else RACCOON_17
    return FirmwareIdentity(_with_firmware_properties(firmware, device), True, (BY_PORT_NOTE.format(port),))


def _with_firmware_properties(firmware: Device, device: Device) -> Device:
    """The columns' device with the properties of a firmware's device."""
    return replace(
        device,
        name=firmware.name,
        position_counts_seconds=firmware.position_counts_seconds,
        bemf_lag=firmware.bemf_lag,
        bemf_dead_zone=firmware.bemf_dead_zone,
        driven_share=firmware.driven_share,
        bemf_range=firmware.bemf_range,
    )


def _contradiction_notes(device: Device, port: str | None) -> tuple[str, ...]:
    """A note if the recording names another firmware than the port does. A simulator's recording contradicts
    no port."""
    own = STOCK_PORT if device.name.startswith(STOCK.name) else RACCOON_PORT
    wombat = device.name.startswith((STOCK.name, f"{RACCOON_PORT}-"))
    if port not in FIRMWARE_PORTS or not wombat or own == port:
        return ()
    return (f'controller.port = "{port}" is not used: the recording says that {device.name} made it',)


def _identity_with_candidate(device: Device, zone: DeadZone) -> FirmwareIdentity:
    ports = {
        DeadZone.STOCK: (STOCK_PORT, STOCK, "the stock firmware", 24),
        DeadZone.RACCOON_21: (RACCOON_PORT, RACCOON_21, "RaccoonOS 21", 10),
    }
    if zone not in ports:
        return FirmwareIdentity(device)
    port, firmware, name, share = ports[zone]
    observation = (
        f"no back-EMF is between 0 and {zone.value}, as on a Wombat with {name}, which lets its motors coast"
    )
    advice_note = (
        f"{observation} for {share} % of the time: if it made this recording, say so (--port {port}, or "
        f'controller.port = "{port}" in robot.toml); otherwise its properties are taken for causes such as a '
        "higher resistance"
    )
    taken_note = (
        f"{observation} for {share} % of the time, and the wheels respond accordingly: treated as one"
    )
    return FirmwareIdentity(
        device,
        notes=(advice_note,),
        candidate=FirmwareIdentity(_with_firmware_properties(firmware, device), True, (taken_note,)),
    )
