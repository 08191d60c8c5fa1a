"""Time of one whole tick and of each part of it: median and 99th percentile, garbage collection on.

    python benchmarks/tick.py [--ticks 20000] [--wall]

The whole tick is `Robot.tick` with a motion in the background, over a recording port and a port that takes
wire frames apart and puts commands together as the stock firmware has them. What it leaves out is the wait
for the bus (45 us on the wire, and the kernel). The parts are then measured one by one on the same readings;
the loop is what remains of the whole. The longest ticks are those in which four tophats are in doubt at once,
in a light that keeps changing: each has a bank of hypotheses to update. Processor time is taken, which other
programs on the machine do not lengthen much; --wall takes the time that passes. A Raspberry Pi 3 is 8 to 12
times slower than a server core; at 200 Hz a tick has 5000 us.
"""

from __future__ import annotations

import argparse
import gc
import random
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from raccoon import Inputs, Outputs, Robot, RobotConfig, drive
from raccoon.core.config import TophatConfig
from raccoon.estimate.battery.state import PackState
from raccoon.estimate.battery.voltage import BatteryVoltage
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.tophat import TophatCalibration, Verdict, calibrate
from raccoon.estimate.tophat.calibration import Surface
from raccoon.hal.wombat.firmware.stock import commands as stock_commands
from raccoon.hal.wombat.firmware.stock import wire as stock
from raccoon.model.paper import TOPHAT_READINGS
from raccoon.model.reflectance import drive_over_line, light_of
from raccoon.robot.parts.drive import Drive
from raccoon.trace.record import RecordingPort

CONFIG = RobotConfig(tophats={"front": TophatConfig()})
PERIOD = 0.005
DOUBTFUL_WHITE = 600.0
BUDGET_US = 1e6 * PERIOD
PI_FACTOR = (8, 12)
Clock = Callable[[], int]


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
        self.sent = stock_commands.encode(outputs, self._count)

    def close(self) -> None:
        """Nothing to switch off."""


def frames(count: int, speed: int = 1400) -> tuple[list[bytes], list[tuple[int, ...]]]:
    """Frames of a robot at a steady speed (counts of back-EMF; 1400 are 0.15 m/s), with noise in the low
    bits."""
    made: list[bytes] = []
    bemf: list[tuple[int, ...]] = []
    for index in range(count):
        image = bytearray(stock.LENGTH)
        image[0:3] = b"\x4a\x00\x08"
        read = speed + index * 7919 % 11 - 5
        bemf.append((read, read + 3, 0, 0))
        for channel in (0, 1):
            image[42 + 4 * channel : 46 + 4 * channel] = (read * index).to_bytes(4, "big")
        image[11:13] = (200 + index % 5).to_bytes(2, "big")
        image[28:30] = (-8192 + index % 7).to_bytes(2, "big", signed=True)
        image[34:36] = (index % 5 - 2).to_bytes(2, "big", signed=True)
        image[86:88] = (748 + index % 3).to_bytes(2, "big")
        made.append(bytes(image))
    return made, bemf


def timed(call: Callable[[int], object], ticks: int, clock: Clock) -> tuple[float, float]:
    """Median and 99th percentile of a call in microseconds, after a warm-up, less what the clock takes."""
    for index in range(200):
        call(index)
    empty = min(clock() - begin for begin in (clock() for _ in range(1000)))
    spent = []
    for index in range(200, 200 + ticks):
        begin = clock()
        call(index)
        spent.append(clock() - begin - empty)
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


def whole(ticks: int, record: Path | None, clock: Clock) -> tuple[float, float]:
    """Robot.tick in one piece."""
    port: FramePort | RecordingPort = FramePort(*frames(1000))
    if record is not None:
        port = RecordingPort(port, record, config=CONFIG)
    with calibrated_robot(port) as robot:
        return timed(lambda _: robot.tick(), ticks, clock)


class ShadyPort(FramePort):
    """A robot at 0.25 m/s with a tophat at every analog port, in a light that jumps four times a second."""

    def __init__(self) -> None:
        super().__init__(*frames(1000, speed=2333))
        self._random, self._light = random.Random(3), 1.0

    def read(self) -> Inputs:
        """Decode one frame, and read the tophats in the present light."""
        inputs = super().read()
        if self._count % 50 == 0:
            self._light = self._random.uniform(0.2, 5.0)
        white = 4095.0 / (1.0 + self._light * light_of(DOUBTFUL_WHITE))
        counts = [white + self._random.gauss(0.0, 0.01 * white) for _ in range(4)]
        return replace(inputs, analog=(*counts, None, None))


def in_doubt(ticks: int, clock: Clock) -> tuple[float, float]:
    """Robot.tick while four tophats are in doubt: median and 99th percentile."""
    names = [f"tophat {number}" for number in range(4)]
    config = RobotConfig(
        tophats={name: TophatConfig(number, 0.1, 0.02 * number) for number, name in enumerate(names)}
    )
    levels = Surface(DOUBTFUL_WHITE, 12.0, 300), Surface(3000.0, 12.0, 100)
    spent: list[int] = []
    with Robot(ShadyPort(), config) as robot:
        for name in names:
            robot.tophat(name).calibrate(TophatCalibration.of_surfaces(Verdict.OK, "", *levels, 0.2))
        robot.add_background(drive(0.25))
        for index in range(200 + ticks):
            doubtful = all(robot.tophat(name).lost for name in names)
            begin = clock()
            robot.tick()
            if doubtful and index >= 200:
                spent.append(clock() - begin)
    spent.sort()
    return statistics.median(spent) / 1000.0, spent[int(0.99 * len(spent))] / 1000.0


def parts(ticks: int, clock: Clock) -> dict[str, tuple[float, float]]:
    """Each part of the tick by itself."""
    made, bemf = frames(1000)

    def read(index: int) -> Inputs:
        registers = stock.decode(made[index % 1000])
        return stock.inputs(registers, PERIOD * (index + 1), bemf=bemf[index % 1000])

    ready = [read(index) for index in range(ticks + 200)]
    robot = calibrated_robot(FramePort(made, bemf))
    for _ in range(200):
        robot.tick()
    odometry, battery, pack, base = Odometry(CONFIG), BatteryVoltage(), PackState(), Drive(CONFIG)
    sensor, motion = robot.tophat("front"), drive(0.15).start(robot)
    estimate = odometry.update(ready[0])
    next(motion)

    def decide(_: int) -> None:
        robot.drive.stop()  # as the last tick's command has done
        next(motion)

    def control(_: int) -> Outputs:
        base.velocity(0.15, 0.01)
        return base.outputs(estimate, PERIOD, 6.6)

    def sense(index: int) -> None:
        sensor.take(ready[index])
        sensor.classify(ready[index])

    command = control(0)
    calls: dict[str, Callable[[int], object]] = {
        "decode": read,
        "estimate: odometry": lambda i: odometry.update(ready[i], command),
        "estimate: battery voltage": lambda i: battery.update(ready[i].time, ready[i].battery_voltage),
        "estimate: charge and resistance": lambda i: pack.update(ready[i].time, 6.6, 0.4),
        "estimate: tophat": sense,
        "decide: motion": decide,
        "control: wheel loops": control,
        "encode": lambda i: stock_commands.encode(command, i),
    }
    return {name: timed(call, ticks, clock) for name, call in calls.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--ticks", type=int, default=20000)
    parser.add_argument("--wall", action="store_true", help="the time that passes, not processor time")
    args = parser.parse_args()
    clock: Clock = time.perf_counter_ns if args.wall else time.thread_time_ns
    assert gc.isenabled()
    rows = parts(args.ticks, clock)
    bare = whole(args.ticks, None, clock)
    doubt = in_doubt(args.ticks // 4, clock)
    rows["the loop (what is left of the whole)"] = _rest(bare, rows)
    with tempfile.TemporaryDirectory() as folder:
        recorded = whole(args.ticks, Path(folder) / "tick", clock)
    rows["record (difference of the whole ticks)"] = recorded[0] - bare[0], recorded[1] - bare[1]
    print(f"{args.ticks} ticks, garbage collection on{'':18}median us   99 % us")
    for name, (median, tail) in rows.items():
        print(f"{name:46} {median:10.1f} {tail:9.1f}")
    print(f"{'whole tick, not recorded':46} {bare[0]:10.1f} {bare[1]:9.1f}")
    print(f"{'whole tick':46} {recorded[0]:10.1f} {recorded[1]:9.1f}")
    print(f"{'whole tick, four tophats in doubt':46} {doubt[0]:10.1f} {doubt[1]:9.1f}")
    shown = ("median", recorded[0]), ("99 %", recorded[1]), ("four tophats in doubt, 99 %", doubt[1])
    for name, value in shown:
        share = 100.0 * value / BUDGET_US
        low, high = (factor * share for factor in PI_FACTOR)
        print(f"{name} of the 5000 us: {share:.1f} % here, {low:.0f} to {high:.0f} % on a Raspberry Pi 3")


def _rest(whole: tuple[float, float], rows: dict[str, tuple[float, float]]) -> tuple[float, float]:
    """Medians add up; of tails the sum is only a bound, so what is left of them is nothing at least."""
    medians, tails = (sum(row[place] for row in rows.values()) for place in (0, 1))
    return whole[0] - medians, max(0.0, whole[1] - tails)


if __name__ == "__main__":
    main()
