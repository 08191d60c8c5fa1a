"""A diagnosis as text for a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from raccoon.diagnose.result import CauseResult, Diagnosis, Verdict

_VERDICTS = {
    Verdict.EXPLAINED: "The simulation is wrong, and this is why:",
    Verdict.PARTLY: "The simulation is wrong; a part of it has a name:",
    Verdict.UNKNOWN: "The simulation is wrong in a way that no known cause describes.",
    Verdict.ADEQUATE: "The simulation fits this recording: nothing that matters is wrong.",
    Verdict.NOT_IDENTIFIABLE: "This recording cannot tell.",
}


def terminal_report(diagnosis: Diagnosis) -> str:
    """Plain sentences, the numbers behind them, and what to do next."""
    return "\n".join(_lines(diagnosis))


def _lines(diagnosis: Diagnosis) -> Iterator[str]:
    yield _VERDICTS[diagnosis.verdict]
    for cause in diagnosis.causes:
        yield from _cause(cause)
    if diagnosis.unexplained.depends_on:
        yield f"  ? Something unknown depends on: {', '.join(diagnosis.unexplained.depends_on)}."
    if diagnosis.channels:
        yield ""
        yield "Error on data that was not fitted (before -> after, noise floor):"
    for each in diagnosis.channels:
        numbers = f"{each.rmse_before:9.4g} -> {each.rmse_after:9.4g}   ({each.noise_floor:.4g} {each.unit})"
        yield f"  {each.name:18s} {numbers}"
    unseen = [each.id for each in diagnosis.rejected if each.reason.startswith("not ")]
    if unseen:
        yield ""
        yield f"Could not be seen in this recording: {', '.join(unseen)}."
    for text in diagnosis.suggested_manoeuvres:
        yield f"To learn more: {text}."
    for text in diagnosis.notes:
        yield f"Note: {text}."
    yield f"({diagnosis.seconds:.1f} s)"


def _cause(cause: CauseResult) -> Iterator[str]:
    yield f"  {cause.rank}. {cause.explanation}"
    for name, each in cause.parameters.items():
        unit = f" {each.unit}" if each.unit else ""
        yield f"       {name} {each.value:.4g} +- {each.std:.2g}{unit} (assumed {each.nominal:.4g})"
    gain = cause.gain
    yield (
        f"       error on unseen data {gain.heldout_rmse_before:.2f} without it, "
        f"{gain.heldout_rmse_after:.2f} with it "
        f"(1 is the noise), probability {cause.probability:.2f}"
    )
    if cause.confounded_with:
        yield f"       cannot be told apart here from: {', '.join(cause.confounded_with)}"
