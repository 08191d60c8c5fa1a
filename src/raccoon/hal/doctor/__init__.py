"""The checks of `raccoon doctor`: compare what a robot's hardware does with what it must do.

All of them work on any port, so that they can be tried without a robot.
"""

from raccoon.hal.doctor.examination import examine
from raccoon.hal.doctor.report import Finding, Report, Verdict

__all__ = ["Finding", "Report", "Verdict", "examine"]
