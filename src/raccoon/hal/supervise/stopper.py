"""The process that stops the motors when the robot program is killed or hangs. Standard library only.

Run as a script, never imported by the program: `python -I -S stopper.py TARGET SECONDS HELD FRAME...`.
Standard input is the program's lifeline: a byte now and then shows that the program is alive, "q" that it has
stopped the motors itself. When the lifeline closes, the frames FRAME (hexadecimal) are sent to TARGET:
`spi:DEVICE:HERTZ`, `tty:DEVICE:BAUD` or `unix:PATH` (an emulator in another process). When it is silent for
SECONDS, the frame in the file with the descriptor HELD is sent instead, so that a program that only waits
does not drop what its servos hold; if that file is empty, the frames FRAME. None of the controllers has a
watchdog of its own.
"""

from __future__ import annotations

import _signal as signal  # type: ignore[import-not-found]  # the module signal imports enum, a megabyte
import os
import select
import sys

TYPE_CHECKING = False  # the module typing is large
if TYPE_CHECKING:
    from collections.abc import Callable

REPEATS = 5
PAUSE_SECONDS = 0.01

# From linux/spi/spidev.h: set mode, bits and speed; one transfer.
SPI_WRITE_MODE, SPI_WRITE_BITS, SPI_WRITE_SPEED = 0x40016B01, 0x40016B03, 0x40046B04
SPI_TRANSFER = 0x40206B00


def send_spi(place: str, frames: list[bytes]) -> None:
    """Send the frames on a spidev device by system calls alone; place: `DEVICE:HERTZ`."""
    import fcntl
    from array import array
    from struct import pack

    device, speed = place.rsplit(":", 1)
    descriptor = os.open(device, os.O_RDWR)
    try:
        fcntl.ioctl(descriptor, SPI_WRITE_MODE, pack("B", 0))
        fcntl.ioctl(descriptor, SPI_WRITE_BITS, pack("B", 8))
        fcntl.ioctl(descriptor, SPI_WRITE_SPEED, pack("I", int(speed)))
        for frame in frames:
            out, back = array("B", frame), array("B", bytes(len(frame)))
            addresses = out.buffer_info()[0], back.buffer_info()[0]
            transfer = pack("QQIIHBBI", *addresses, len(frame), int(speed), 50, 8, 0, 0)
            fcntl.ioctl(descriptor, SPI_TRANSFER, transfer)
            select.select([], [], [], PAUSE_SECONDS)
    finally:
        os.close(descriptor)


def send_unix(path: str, frames: list[bytes]) -> None:
    """Send the frames to an emulator behind a socket, each as its length (2 bytes, little-endian) and its
    bytes."""
    import socket

    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(1.0)
        connection.connect(path)
        for frame in frames:
            connection.sendall(len(frame).to_bytes(2, "little") + frame)
            connection.recv(4096)
            select.select([], [], [], PAUSE_SECONDS)


def send_tty(place: str, frames: list[bytes]) -> None:
    """Write the frames to a serial device (an iRobot Create), 8N1, raw; place: `DEVICE:BAUD`."""
    import termios

    device, speed = place.rsplit(":", 1)
    descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        rate = getattr(termios, f"B{speed}")
        control = termios.tcgetattr(descriptor)[6]
        flags = termios.CS8 | termios.CREAD | termios.CLOCAL
        termios.tcsetattr(descriptor, termios.TCSANOW, [0, 0, flags, 0, rate, rate, control])
        for frame in frames:
            os.write(descriptor, frame)
            select.select([], [], [], PAUSE_SECONDS)
    except termios.error as error:  # is no OSError; occurs if the contact bounces between open and set-up
        raise OSError(*error.args) from error
    finally:
        os.close(descriptor)


SENDERS = {"spi": send_spi, "tty": send_tty, "unix": send_unix}


def supervise(lifeline: int, seconds: float, stop: Callable[[], None], hold: Callable[[], None]) -> None:
    """Watch the lifeline until the program has ended. Calls `stop` if it ended without "q", and `hold` each
    time that it has been silent for `seconds`.

    The program may resume after a pause (a debugger, a stopped process); its next frame drives the robot
    again.
    """
    limit: float | None = None
    while True:
        ready, _, _ = select.select([lifeline], [], [], limit)
        if not ready:
            hold()
            limit = None
            continue
        heard = os.read(lifeline, 64)
        if b"q" in heard:
            return
        if not heard:
            stop()
            return
        limit = seconds


def main(arguments: list[str]) -> None:
    """Ignore signals that end a process, then supervise."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(each, signal.SIG_IGN)
    kind, place = arguments[0].split(":", 1)
    frames = [bytes.fromhex(each) for each in arguments[3:]]

    def send(frames: list[bytes]) -> None:
        try:
            SENDERS[kind](place, frames * REPEATS)
        except OSError as error:
            print(f"the motors could not be stopped: {error}", file=sys.stderr)

    def stop() -> None:
        send(frames)

    def hold() -> None:
        held = os.pread(int(arguments[2]), 4096, 0)
        send([held] if held else frames)

    os.write(1, b"r")  # ready: signals are ignored, only a few small modules are left to import
    supervise(0, float(arguments[1]), stop, hold)


if __name__ == "__main__":
    main(sys.argv[1:])
