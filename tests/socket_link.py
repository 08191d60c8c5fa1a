"""The link over a socket: an emulated Wombat in another process, for programs that are killed."""

from __future__ import annotations

import socket
from pathlib import Path

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.link.link import Link

TIMEOUT_SECONDS = 2.0


class SocketLink:
    """Transfers frames to a `serve` in another process. Raises HardwareError where nobody serves."""

    def __init__(self, path: str | Path) -> None:
        self.path = str(path)
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(TIMEOUT_SECONDS)
        try:
            self._socket.connect(self.path)
        except OSError as error:
            self._socket.close()
            raise HardwareError(f"no emulator serves at {self.path}: {error}") from error

    def transfer(self, frame: bytes) -> bytes:
        """One exchange."""
        try:
            self._socket.sendall(len(frame).to_bytes(2, "little") + frame)
            return _receive(self._socket, len(frame))
        except OSError as error:
            raise HardwareError(f"the emulator at {self.path} is gone: {error}") from error

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


def _receive(connection: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise ConnectionResetError("the other side hung up")
        data += part
    return data


def serve_one(connection: socket.socket, link: Link) -> bool:
    """Answer one transfer of a connected program; False where it has hung up."""
    try:
        length = int.from_bytes(_receive(connection, 2), "little")
        connection.sendall(link.transfer(_receive(connection, length)))
    except (ConnectionError, OSError):
        return False
    return True
