"""The findings of an examination: what was measured, how bad it is and what to do about it."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class Verdict(StrEnum):
    """The result of one check. NOT_CHECKED (absent, or nothing to judge it by) does not count against the
    robot."""

    OK = "ok"
    WARNING = "warning"
    FAULT = "fault"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report.

    subject: what was checked. measured: the result as text. values: the same numbers for programs, in SI
    units unless the key names a unit. problem, remedy: what is wrong and what to do; empty if nothing is
    wrong.
    """

    subject: str
    verdict: Verdict
    measured: str
    problem: str = ""
    remedy: str = ""
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(slots=True)
class Report:
    """All findings, in the order in which they are shown."""

    findings: list[Finding] = field(default_factory=list)

    def add(self, *findings: Finding) -> None:
        self.findings += findings

    @property
    def well(self) -> bool:
        """Whether at least one check gave a verdict and all of these are OK."""
        judged = [finding.verdict for finding in self.findings if finding.verdict is not Verdict.NOT_CHECKED]
        return bool(judged) and all(verdict is Verdict.OK for verdict in judged)

    def as_json(self) -> dict[str, object]:
        """The report as a dictionary for `json.dumps`."""
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
        """The report as text of `width` columns: a row for each finding, problem and remedy below it."""
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
