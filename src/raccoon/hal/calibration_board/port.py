"""A port that adds the pose of a reference system."""

from __future__ import annotations

from dataclasses import replace

from raccoon.core.clock import RealClock
from raccoon.core.port import Port
from raccoon.core.readings import Inputs
from raccoon.hal.added_sensor import AddedSensorPort, with_loss
from raccoon.hal.calibration_board.board import BAUD, CalibrationBoard
from raccoon.hal.calibration_board.tracker import CENTRED, Mounting
from raccoon.hal.serial_line import SerialLine


class ReferencePort(AddedSensorPort):
    """Wraps `port`: `truth` becomes the board's pose, or None if that cannot be trusted.

    `extra` gains reference.turn_rate (rad/s) and reference.quality (surface quality of the flow sensor). A
    silent board adds the fault SENSOR_LOST; it never delays a cycle. The pose is as old as the board's newest
    frame, up to 10 ms (its attitude comes at 100 Hz).
    """

    def __init__(self, port: Port, board: CalibrationBoard) -> None:
        super().__init__(port, board)
        self._board = board

    def read(self) -> Inputs:
        """The wrapped port's next cycle with the reference added."""
        inputs = self._port.read()
        board = self._board
        board.poll()
        if board.silent:
            return replace(inputs, truth=None, faults=with_loss(inputs.faults, True))
        extra = dict(inputs.extra or {})
        if board.tracker.turn_rate is not None:
            extra["reference.turn_rate"] = board.tracker.turn_rate
        if board.tracker.squal is not None:
            extra["reference.quality"] = float(board.tracker.squal)
        return replace(inputs, truth=board.truth(), extra=extra or None)


def open_reference(port: Port, path: str = "/dev/ttyACM0", mounting: Mounting = CENTRED) -> ReferencePort:
    """Wrap `port` with the calibration board on `path`. Raises HardwareError if the board is not there."""
    clock = RealClock()
    return ReferencePort(port, CalibrationBoard(SerialLine(path, BAUD, clock), clock, mounting))
