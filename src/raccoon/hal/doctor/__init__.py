"""The checks behind `raccoon doctor`: what a robot's hardware does, against what it must do.

Everything here works on any port, so that it can be tried without a robot.
"""

from raccoon.hal.doctor.examination import examine
from raccoon.hal.doctor.report import Finding, Report, Verdict

__all__ = ["Finding", "Report", "Verdict", "examine"]
