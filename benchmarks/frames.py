"""What it costs to speak to a Wombat: microseconds a frame, for each firmware.

    python benchmarks/frames.py

"encode": `Outputs` to bytes. "decode": bytes to `Inputs` with every field that a cycle needs, in the order,
signs and units of this library. "bare": one struct.unpack of the same fields of both directions, the floor of
any codec in this language. "IMU again": a frame whose IMU words the port has had before, three of four
from RaccoonOS. Medians of batches that take turns, so that a busy machine is busy for all of them.
"""

from __future__ import annotations

import argparse
import statistics
import struct
import sys
import timeit
from collections.abc import Callable

from raccoon.core.readings import Outputs
from raccoon.hal.wombat.firmware.raccoon import commands as raccoon_commands
from raccoon.hal.wombat.firmware.raccoon import wire as raccoon
from raccoon.hal.wombat.firmware.stock import commands as stock_commands
from raccoon.hal.wombat.firmware.stock import wire as stock

LIMIT_US = 40.0
LIMIT_RATIO = 2.0
BATCHES, BATCH = 300, 200
OUTPUTS = Outputs(duty=(0.37, -0.52, 0.0, 0.0), brake=(True, True, False, False))
STOCK_REPLY = stock.MAGIC + bytes(range(86))
STOCK_FIELDS = ">B5H6HB9h4i4B4h4H4HHB"
STOCK_COMMAND_FIELDS = f"{4 + 2 * len(stock_commands.IMAGE)}B"
RACCOON_FIELDS = "<BI4i4iB6hhH3fb3fb3fb3fb3fb4fbff6f"
RACCOON_COMMAND_FIELDS = {17: "<BIBH4i4iBB4H5f12f9b9b12f4f12f", 21: "<BIBH4i3f4iBB4H5f12f9b9b12f4f4f12fB"}

Call = Callable[[], object]


def microseconds(*calls: Call) -> list[float]:
    """Median time of each call, over batches that take turns."""
    timers = [timeit.Timer(call) for call in calls]
    turns = [[timer.timeit(BATCH) for timer in timers] for _ in range(BATCHES)]
    return [statistics.median(times) / BATCH * 1e6 for times in zip(*turns, strict=True)]


def raccoon_reply(version: int) -> bytes:
    """A frame of a robot that stands still."""
    reply = bytearray(raccoon.FRAME_LENGTH[version])
    reply[0] = version
    struct.pack_into("<f", reply, 119, 1.0)
    struct.pack_into("<f", reply, 75, 9.81)
    return bytes(reply)


def stock_calls() -> tuple[Call, Call, Call, Call]:
    """Encode, decode, decode without the IMU, and the floor."""
    command = stock_commands.encode(OUTPUTS)

    def bare() -> None:
        struct.unpack(STOCK_FIELDS, STOCK_REPLY)
        struct.unpack_from(STOCK_COMMAND_FIELDS, command)

    return (
        lambda: stock_commands.encode(OUTPUTS, 7),
        lambda: stock.inputs(stock.decode(STOCK_REPLY), 1.0),
        lambda: stock.inputs(stock.decode(STOCK_REPLY), 1.0, imu=False),
        bare,
    )


def raccoon_calls(version: int) -> tuple[Call, Call, Call, Call]:
    """The same of one RaccoonOS version."""
    reply, command = raccoon_reply(version), raccoon_commands.encode(OUTPUTS, version)
    fields = RACCOON_COMMAND_FIELDS[version]

    def bare() -> None:
        struct.unpack_from(RACCOON_FIELDS, reply)
        struct.unpack(fields, command)

    return (
        lambda: raccoon_commands.encode(OUTPUTS, version),
        lambda: raccoon.inputs(raccoon.decode(reply, version), 1.0),
        lambda: raccoon.inputs(raccoon.decode(reply, version), 1.0, imu=False),
        bare,
    )


def main() -> int:
    """Print the table; exit status 1 where a frame takes longer than 40 us."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"{'':26}{'encode':>9}{'decode':>9}{'both':>9}{'asked':>9}{'bare':>9}{'both/bare':>11}{'asked':>7}")
    slow = False
    sets = {"stock": stock_calls(), "RaccoonOS 17": raccoon_calls(17), "RaccoonOS 21": raccoon_calls(21)}
    for name, calls in sets.items():
        encode, decode, again, bare = microseconds(*calls)
        for what, took in ((name, decode), (f"{name}, IMU again", again)):
            both = encode + took
            slow = slow or both > LIMIT_US
            print(
                f"{what:26}{encode:9.2f}{took:9.2f}{both:9.2f}{LIMIT_US:9.1f}{bare:9.2f}"
                f"{both / bare:11.2f}{LIMIT_RATIO:7.1f}"
            )
    print("microseconds")
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
