"""The calibration board (optical flow and a six-axis IMU on USB) as a reference system for `truth.*`."""

from raccoon.hal.calibration_board.board import BAUD, CalibrationBoard
from raccoon.hal.calibration_board.port import ReferencePort, open_reference
from raccoon.hal.calibration_board.tracker import FlowTracker, Mounting

__all__ = ["BAUD", "CalibrationBoard", "FlowTracker", "Mounting", "ReferencePort", "open_reference"]
