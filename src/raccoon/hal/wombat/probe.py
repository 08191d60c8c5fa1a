"""Detection of the firmware that answers, without moving anything.

Sends only zeros: the stock firmware ignores them, RaccoonOS takes them for "motors and servos off".
"""

from __future__ import annotations

from raccoon.core.clock import Clock
from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.firmware.dialect import Dialect
from raccoon.hal.wombat.firmware.raccoon import wire as raccoon
from raccoon.hal.wombat.firmware.raccoon.dialect import NEWEST_IN_THE_WILD, RaccoonDialect
from raccoon.hal.wombat.firmware.stock import commands as stock_commands
from raccoon.hal.wombat.firmware.stock import wire as stock
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect
from raccoon.hal.wombat.link.link import Link

ATTEMPTS = 30
PAUSE_SECONDS = 0.1

FRAMES = 10
"""Number of complete stock frames that contain two frames of any RaccoonOS at any shift."""


def probe(link: Link, clock: Clock) -> Dialect:
    """The dialect of the firmware behind the link, which is aligned then. Waits up to 3 s for a controller
    that is still starting.

    Raises HardwareError if no firmware answers or none that this library speaks; the message says what was
    received.
    """
    seen = b""
    for attempt in range(ATTEMPTS):
        if attempt:
            clock.sleep_until(clock.now() + PAUSE_SECONDS)
        seen = b"".join(link.transfer(stock_commands.READ) for _ in range(FRAMES))
        dialect = _recognise(link, seen)
        if dialect is not None:
            return dialect
        if attempt == 0:  # later attempts begin anywhere in a frame of unknown length
            _refuse_known_strangers(seen)
    raise HardwareError(_describe_seen(seen))


def _recognise(link: Link, stream: bytes) -> Dialect | None:
    # The last frames of the stream: the first may still carry a byte from before a restart.
    if stream[-stock.LENGTH :].startswith(stock.MAGIC):
        return StockDialect()
    for version in raccoon.FRAME_LENGTH:
        found = _recognise_raccoon(link, stream, version)
        if found is not None:
            return found
    index = stock.find_shift(stream[-stock.LENGTH :])
    if index is not None:
        link.transfer(bytes(index))
        return StockDialect()
    return None


def _recognise_raccoon(link: Link, stream: bytes, version: int) -> Dialect | None:
    length = raccoon.FRAME_LENGTH[version]
    index = raccoon.find_shift(stream, version)
    if index is None:
        return None
    # The link is at byte `behind` of a frame: transfer the rest of that frame.
    behind = (len(stream) - index) % length
    if behind:
        link.transfer(bytes(length - behind))
    return RaccoonDialect(version)


def _refuse_known_strangers(stream: bytes) -> None:
    """Raise HardwareError for a firmware that answers correctly, but in a version that this library does not
    speak."""
    first = stream[0]
    if first == stock.START and stream[1] == 0 and len(set(stream[3:89])) > 1:
        raise HardwareError(
            f"the stock firmware answers with version {stream[2]}: this library speaks"
            f" {stock.FIRMWARE_VERSION}; flash the firmware of a current Wombat image"
        )
    padded = not any(stream[raccoon.DATA_LENGTH : 199])
    if 8 <= first <= NEWEST_IN_THE_WILD and first not in raccoon.FRAME_LENGTH and padded:
        raise HardwareError(
            f"RaccoonOS answers with protocol version {first}: this library speaks"
            f" {' and '.join(map(str, raccoon.FRAME_LENGTH))}; update the firmware or the library"
        )


def _describe_seen(seen: bytes) -> str:
    if not any(seen):
        return (
            "the controller does not answer (all 0x00): no power, held in reset, or flashed with no firmware;"
            " check the battery and switch the Wombat off and on"
        )
    if seen == b"\xff" * len(seen):
        return (
            "the controller does not answer (all 0xFF): no power or a broken link;"
            " switch the Wombat off and on"
        )
    return f"no known firmware answers; the link says {seen[:24].hex(' ')} ...: switch the Wombat off and on"
