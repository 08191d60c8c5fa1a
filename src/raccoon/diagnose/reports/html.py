"""Report of a diagnosis as one HTML file with embedded figures. Needs the extra [report]."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.extras import install
from raccoon.core.files import write_atomically
from raccoon.diagnose.reports.cause_text import describe_cause
from raccoon.diagnose.reports.headline import (
    other_robot_question,
    reason_it_cannot_tell,
    verdict_text,
    visible_sizes_text,
)
from raccoon.diagnose.reports.numbers import format_std, format_value
from raccoon.diagnose.reports.pictures import (
    cause_figure,
    curve_figure,
    error_figure,
    figure_to_base64_png,
    shape_figure,
)
from raccoon.diagnose.reports.plain_names import capitalise, plain_name
from raccoon.diagnose.reports.terminal import (
    NOT_SHOWN_PREFIX,
    change_text,
    channel_residual_text,
    compensation_text,
    evidence_text,
    next_recording_advice,
    probability_text,
    reasons_not_named,
    terminal_report,
    unexplained_share_text,
    unrepeated_notes,
)
from raccoon.diagnose.reports.unknown_text import depends_text, shape_text
from raccoon.diagnose.result import CauseResult, Diagnosis, Verdict

MAX_CURVES = 6
"""Largest number of channels with a figure over time."""


def save_html(diagnosis: Diagnosis, path: str | Path, title: str = "a recording") -> None:
    """Write the report, atomically. title: what was diagnosed. Raises ConfigError if jinja2 or matplotlib is
    not installed."""
    write_atomically(Path(path), render_page(diagnosis, title))


def render_page(diagnosis: Diagnosis, title: str) -> str:
    """The report as HTML. Raises ConfigError if jinja2 or matplotlib is not installed."""
    why, unexplained = reasons_not_named(diagnosis), diagnosis.unexplained
    text: str = load_template("report.html").render(
        title=title,
        diagnosis=diagnosis,
        verdict=str(diagnosis.verdict).replace("_", " "),
        headline=_headline(diagnosis),
        asked=other_robot_question(diagnosis),
        sentence=verdict_text(diagnosis).rstrip(":.") + ".",
        seen=visible_sizes_text(diagnosis) or _reason_sentence(diagnosis),
        told=[describe_cause(each) for each in diagnosis.causes],
        todo=[_action_text(each) for each in diagnosis.causes],
        judged=[compensation_text(each, diagnosis) or _held_out_text(each) for each in diagnosis.causes],
        sure=[probability_text(each) for each in diagnosis.causes],
        advice=next_recording_advice(diagnosis),
        notes=unrepeated_notes(diagnosis),
        changes=[change_text(each, diagnosis) for each in diagnosis.causes],
        errors=figure_to_base64_png(error_figure(diagnosis)) if diagnosis.channels else None,
        rest=[channel_residual_text(diagnosis, each) for each in diagnosis.channels],
        evidence=figure_to_base64_png(cause_figure(diagnosis)) if diagnosis.causes else None,
        left=f"{unexplained_share_text(unexplained)} {depends_text(unexplained.depends_on)}",
        shapes=[
            (shape_text(each).replace("+-", "±"), figure_to_base64_png(shape_figure(each)))
            for each in diagnosis.shapes
        ],
        curves=[
            (each, figure_to_base64_png(curve_figure(each, diagnosis)))
            for each in diagnosis.curves[:MAX_CURVES]
        ],
        refused={reason: ids for reason, ids in why.items() if not reason.startswith(NOT_SHOWN_PREFIX)},
        hidden={reason: ids for reason, ids in why.items() if reason.startswith(NOT_SHOWN_PREFIX)},
        text=terminal_report(diagnosis),
        precise=format_value,
        deviation=format_std,
    )
    return text


@cache
def load_template(name: str) -> Any:
    """A page template of this package. Raises ConfigError if jinja2 or matplotlib is not installed."""
    try:
        import jinja2
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise ConfigError(f"an HTML report needs jinja2 and matplotlib: {install('report')}") from error
    pages = files("raccoon.diagnose.reports").joinpath("pages")
    texts = {each.name: each.read_text("utf-8") for each in pages.iterdir() if each.name.endswith(".html")}
    return jinja2.Environment(autoescape=True, loader=jinja2.DictLoader(texts)).get_template(name)


def _headline(diagnosis: Diagnosis) -> str:
    """The first cause in one sentence if it matters, and on what something unknown beside it depends; else
    the first sensor fault, else the verdict."""
    if diagnosis.causes and not diagnosis.causes[0].is_negligible:
        unknown = depends_text(diagnosis.unexplained.depends_on)
        beside = f" Something that no cause describes acts as well: it depends on {unknown}."
        return f"{_problem_sentence(diagnosis.causes[0])}{beside if unknown else ''}"
    if diagnosis.sensor_faults:
        return f"{capitalise(diagnosis.sensor_faults[0].text)}."
    return verdict_text(diagnosis)


def _reason_sentence(diagnosis: Diagnosis) -> str:
    """The reason for a verdict of not identifiable; "" for other verdicts."""
    why = reason_it_cannot_tell(diagnosis) if diagnosis.verdict is Verdict.NOT_IDENTIFIABLE else ""
    return f"{capitalise(why)}." if why else ""


def _problem_sentence(cause: CauseResult) -> str:
    """What is wrong, with the rivals that it may be instead or in part."""
    others = [plain_name(each) for each in cause.confounded_with if each not in cause.beside]
    instead = f"; or it is {' or '.join(others)}" if others else ""
    part = f"; a part of it may be {' or '.join(map(plain_name, cause.beside))}" if cause.beside else ""
    what = describe_cause(cause).what.partition(". ")[0]
    return f"{what}{instead}{part}."


def _held_out_text(cause: CauseResult) -> str:
    """Held-out evidence of a cause, and the share of the possible gain that is lost without it. The shares of
    several causes may add up to more than 100 %."""
    share = round(100.0 * cause.gain.share)
    lost = f"; without it, {share} % of the possible improvement is lost"
    return f"{evidence_text(cause)}{lost if share else ''}"


def _action_text(cause: CauseResult) -> str:
    """The advice for a cause, conditional if it has rivals; "" for a negligible cause."""
    advice = "" if cause.is_negligible else describe_cause(cause).todo
    if advice and set(cause.confounded_with) - set(cause.beside):
        return f"If it is {plain_name(cause.name)}: {advice}."
    return f"{capitalise(advice)}." if advice else ""
