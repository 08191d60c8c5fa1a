"""What it costs to speak to a Wombat: microseconds a frame, for each firmware.

    python benchmarks/frames.py

"words": `Outputs` to bytes, and bytes to the fields of the wire, whose tuples are made when asked for.
"readings": to `Inputs` at once, which is what a cycle needs. "bare": one struct.unpack of the same fields of
both directions, the floor of any codec in this language. Medians of batches.
"""

from __future__ import annotations

import statistics
import struct
import sys
import timeit
from collections.abc import Callable

from raccoon.core.readings import Outputs
from raccoon.hal.wombat import raccoon, raccoon_command, stock, stock_command

LIMIT_US = 40.0
OUTPUTS = Outputs(duty=(0.37, -0.52, 0.0, 0.0))
STOCK_REPLY = stock.MAGIC + bytes(range(86))
STOCK_FIELDS = ">B5H6HB9h4i4B4h4H4HHB"
STOCK_COMMAND_FIELDS = f"{4 + 2 * len(stock_command.IMAGE)}B"
RACCOON_FIELDS = "<BI4i4iB6hhH3fb3fb3fb3fb3fb4fbff6f"
RACCOON_COMMAND_FIELDS = {17: "<BIBH4i4iBB4H5f12f9b9b12f4f12f", 21: "<BIBH4i3f4iBB4H5f12f9b9b12f4f4f12fB"}


def microseconds(call: Callable[[], object]) -> float:
    """Median time of one call over 200 batches of 200."""
    return statistics.median(timeit.repeat(call, number=200, repeat=200)) / 200 * 1e6


def raccoon_reply(version: int) -> bytes:
    """A frame of a robot that stands still."""
    reply = bytearray(raccoon.FRAME_LENGTH[version])
    reply[0] = version
    struct.pack_into("<f", reply, 119, 1.0)
    struct.pack_into("<f", reply, 75, 9.81)
    return bytes(reply)


def rows() -> list[tuple[str, float, float, float, float]]:
    """Name, encode, decode, both (us), and the bare floor."""
    table = []
    command = stock_command.encode(OUTPUTS)

    def stock_floor() -> None:
        struct.unpack(STOCK_FIELDS, STOCK_REPLY)
        struct.unpack_from(STOCK_COMMAND_FIELDS, command)

    floor = microseconds(stock_floor)
    encode = microseconds(lambda: stock_command.encode(OUTPUTS, 7))
    for name, decode in (
        ("stock, words", microseconds(lambda: stock.decode(STOCK_REPLY))),
        ("stock, readings", microseconds(lambda: stock.inputs(stock.decode(STOCK_REPLY), 1.0))),
    ):
        table.append((name, encode, decode, encode + decode, floor))
    for version in (17, 21):
        table += raccoon_rows(version)
    return table


def raccoon_rows(version: int) -> list[tuple[str, float, float, float, float]]:
    """The rows of one RaccoonOS version."""
    reply, command = raccoon_reply(version), raccoon_command.encode(OUTPUTS, version)
    fields = RACCOON_COMMAND_FIELDS[version]

    def bare() -> None:
        struct.unpack_from(RACCOON_FIELDS, reply)
        struct.unpack(fields, command)

    floor = microseconds(bare)
    encode = microseconds(lambda: raccoon_command.encode(OUTPUTS, version))
    words = microseconds(lambda: raccoon.decode(reply, version))
    readings = microseconds(lambda: raccoon.inputs(raccoon.decode(reply, version), 1.0))
    return [
        (f"RaccoonOS {version}, words", encode, words, encode + words, floor),
        (f"RaccoonOS {version}, readings", encode, readings, encode + readings, floor),
    ]


def main() -> int:
    """Print the table; exit status 1 where a frame takes longer than 40 us."""
    print(f"{'':24}{'encode':>9}{'decode':>9}{'both':>9}{'bare':>9}{'both/bare':>11}   us")
    slow = False
    for name, encode, decode, both, floor in rows():
        slow = slow or both > LIMIT_US
        print(f"{name:24}{encode:9.2f}{decode:9.2f}{both:9.2f}{floor:9.2f}{both / floor:11.2f}")
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
