"""What was found, how bad it is and what to do about it."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class Verdict(StrEnum):
    """Of one check. NOT_CHECKED (absent, or nothing to judge it by) does not spoil the whole."""

    OK = "ok"
    WARNING = "warning"
    FAULT = "fault"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report.

    subject: what was checked. measured: the result for people. values: the same numbers for programs, SI.
    problem, remedy: what is wrong and what to do; empty where nothing is.
    """

    subject: str
    verdict: Verdict
    measured: str
    problem: str = ""
    remedy: str = ""
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(slots=True)
class Report:
    """All findings, in the order they were made."""

    findings: list[Finding] = field(default_factory=list)

    def add(self, *findings: Finding) -> None:
        self.findings += findings

    @property
    def well(self) -> bool:
        """True where something was found and nothing of it is wrong."""
        judged = [finding.verdict for finding in self.findings if finding.verdict is not Verdict.NOT_CHECKED]
        return bool(judged) and all(verdict is Verdict.OK for verdict in judged)

    def as_json(self) -> dict[str, object]:
        """For `json.dumps`."""
        return {
            "well": self.well,
            "findings": [
                {
                    "subject": each.subject,
                    "verdict": each.verdict.value,
                    "measured": each.measured,
                    "problem": each.problem,
                    "remedy": each.remedy,
                    "values": dict(each.values),
                }
                for each in self.findings
            ],
        }

    def table(self, width: int = 100) -> str:
        """For people: one row a finding, problem and remedy below it."""
        subject_width = max((len(each.subject) for each in self.findings), default=0)
        verdict_width = max((len(each.verdict.value) for each in self.findings), default=0)
        margin = " " * (subject_width + verdict_width + 4)
        lines = []
        for each in self.findings:
            row = f"{each.subject:<{subject_width}}  {each.verdict.value:<{verdict_width}}  "
            lines += _wrapped(row, each.measured, width) or [row.rstrip()]
            for label, text in (("! ", each.problem), ("> ", each.remedy)):
                lines += _wrapped(margin + label, text, width)
        return "\n".join([*lines, "", self._summary()])

    def _summary(self) -> str:
        counts = dict.fromkeys(Verdict, 0)
        for each in self.findings:
            counts[each.verdict] += 1
        if self.well:
            return f"All is well: {counts[Verdict.OK]} checks."
        wrong = f"faults: {counts[Verdict.FAULT]}, warnings: {counts[Verdict.WARNING]}"
        return f"{wrong}, ok: {counts[Verdict.OK]}"


def _wrapped(lead: str, text: str, width: int) -> list[str]:
    if not text:
        return []
    indent = " " * len(lead)
    return textwrap.wrap(text, max(width, len(lead) + 30), initial_indent=lead, subsequent_indent=indent)
