"""Time of one whole tick and of each part of it: median and 99th percentile, garbage collection on.

    python benchmarks/tick.py [--ticks 20000]

The whole tick is `Robot.tick` with a motion in the background, over a recording port and a port that takes
wire frames apart and puts commands together as the stock firmware has them. What it leaves out is the wait
for the bus (45 us on the wire, and the kernel). The parts are then measured one by one on the same readings.
A Raspberry Pi 3 is 8 to 12 times slower than a server core; at 200 Hz a tick has 5000 us.
"""

from __future__ import annotations

import argparse
import gc
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from raccoon import Inputs, Outputs, Robot, RobotConfig, drive
from raccoon.core.config import TophatConfig
from raccoon.estimate.battery.voltage import BatteryVoltage
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.tophat import calibrate
from raccoon.hal.wombat import stock, stock_command
from raccoon.model.paper import TOPHAT_READINGS
from raccoon.model.reflectance import drive_over_line
from raccoon.robot.drive import Drive
from raccoon.trace.record import RecordingPort

CONFIG = RobotConfig(tophats={"front": TophatConfig()})
PERIOD = 0.005
BUDGET_US = 1e6 * PERIOD
PI_FACTOR = (8, 12)


class FramePort:
    """Answers every read with the next prepared frame, decoded; encodes every command."""

    def __init__(self, frames: list[bytes], bemf: list[tuple[int, ...]]) -> None:
        self._frames = frames
        self._bemf = bemf
        self._count = 0
        self.sent = b""

    def read(self) -> Inputs:
        """Decode one frame."""
        index = self._count % len(self._frames)
        self._count += 1
        registers = stock.decode(self._frames[index])
        return stock.inputs(registers, PERIOD * self._count, bemf=self._bemf[index])

    def write(self, outputs: Outputs) -> None:
        """Encode one command."""
        self.sent = stock_command.encode(outputs, self._count)

    def close(self) -> None:
        """Nothing to switch off."""


def frames(count: int) -> tuple[list[bytes], list[tuple[int, ...]]]:
    """Frames of a robot that drives at a steady 0.15 m/s, with noise in the low bits."""
    made: list[bytes] = []
    bemf: list[tuple[int, ...]] = []
    for index in range(count):
        image = bytearray(stock.LENGTH)
        image[0:3] = b"\x4a\x00\x08"
        speed = 1400 + index * 7919 % 11 - 5
        bemf.append((speed, speed + 3, 0, 0))
        for channel in (0, 1):
            image[42 + 4 * channel : 46 + 4 * channel] = (speed * index).to_bytes(4, "big")
        image[11:13] = (200 + index % 5).to_bytes(2, "big")
        image[28:30] = (-8192 + index % 7).to_bytes(2, "big", signed=True)
        image[34:36] = (index % 5 - 2).to_bytes(2, "big", signed=True)
        image[86:88] = (748 + index % 3).to_bytes(2, "big")
        made.append(bytes(image))
    return made, bemf


def timed(call: Callable[[int], object], ticks: int) -> tuple[float, float]:
    """Median and 99th percentile of a call in microseconds, after a warm-up."""
    for index in range(200):
        call(index)
    clock, spent = time.perf_counter_ns, []
    for index in range(200, 200 + ticks):
        begin = clock()
        call(index)
        spent.append(clock() - begin)
    spent.sort()
    return statistics.median(spent) / 1000.0, spent[int(0.99 * len(spent))] / 1000.0


def calibrated_robot(port: FramePort | RecordingPort) -> Robot:
    """A robot with a calibrated tophat that drives in the background."""
    import numpy as np

    robot = Robot(port, CONFIG)
    samples, _ = drive_over_line(np.random.default_rng(1), TOPHAT_READINGS[0])
    robot.tophat("front").calibrate(calibrate(samples))
    robot.add_background(drive(0.15))
    return robot


def whole(ticks: int, record: Path | None) -> tuple[float, float]:
    """Robot.tick in one piece."""
    port: FramePort | RecordingPort = FramePort(*frames(1000))
    if record is not None:
        port = RecordingPort(port, record, config=CONFIG)
    with calibrated_robot(port) as robot:
        return timed(lambda _: robot.tick(), ticks)


def parts(ticks: int) -> dict[str, tuple[float, float]]:
    """Each part of the tick by itself."""
    made, bemf = frames(1000)
    ready = [
        stock.inputs(stock.decode(made[index % 1000]), PERIOD * (index + 1), bemf=bemf[index % 1000])
        for index in range(ticks + 200)
    ]
    odometry, battery, base = Odometry(CONFIG), BatteryVoltage(), Drive(CONFIG)
    sensor = calibrated_robot(FramePort(made, bemf)).tophat("front")
    estimate = odometry.update(ready[0])

    def control(_: int) -> Outputs:
        base.velocity(0.15, 0.01)
        return base.outputs(estimate, PERIOD, 6.6)

    command = control(0)
    return {
        "decode": timed(
            lambda i: stock.inputs(stock.decode(made[i % 1000]), PERIOD * i, bemf=bemf[i % 1000]), ticks
        ),
        "estimate: odometry": timed(lambda i: odometry.update(ready[i], command), ticks),
        "estimate: battery": timed(lambda i: battery.update(ready[i].time, ready[i].battery_voltage), ticks),
        "estimate: tophat": timed(lambda i: sensor.update(ready[i]), ticks),
        "control": timed(control, ticks),
        "encode": timed(lambda i: stock_command.encode(command, i), ticks),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=20000)
    ticks = parser.parse_args().ticks
    assert gc.isenabled()
    rows = parts(ticks)
    bare = whole(ticks, None)
    with tempfile.TemporaryDirectory() as folder:
        recorded = whole(ticks, Path(folder) / "tick")
    rows["record (difference of the whole ticks)"] = recorded[0] - bare[0], recorded[1] - bare[1]
    print(f"{ticks} ticks, garbage collection on{'':18}median us   99 % us")
    for name, (median, tail) in rows.items():
        print(f"{name:46} {median:10.1f} {tail:9.1f}")
    print(f"{'whole tick, not recorded':46} {bare[0]:10.1f} {bare[1]:9.1f}")
    print(f"{'whole tick':46} {recorded[0]:10.1f} {recorded[1]:9.1f}")
    share = 100.0 * recorded[0] / BUDGET_US
    low, high = (factor * share for factor in PI_FACTOR)
    print(f"of the 5000 us at 200 Hz: {share:.1f} % here, {low:.0f} to {high:.0f} % on a Raspberry Pi 3")


if __name__ == "__main__":
    main()
