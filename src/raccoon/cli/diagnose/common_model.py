"""`raccoon diagnose --save-model` for many recordings: what they have in common, and what that foresees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.diagnose.job import Answer, Job

if TYPE_CHECKING:
    from raccoon.diagnose.fleet.common_model import CrossCheck
    from raccoon.diagnose.fleet.summary import Fleet
    from raccoon.sim.effects.parameters import Parameters


@dataclass(frozen=True, slots=True)
class CommonModel:
    """The model of a fleet, None where there is none, which `reason` says. foreseen: each recording with the
    model of the others."""

    model: Parameters | None
    foreseen: Mapping[str, CrossCheck]
    reason: str = ""


def make_common_model(
    fleet: Fleet, jobs: Mapping[str, Job], work: Callable[[list[Job]], Sequence[Answer | str]]
) -> CommonModel:
    """Each recording is diagnosed again, from the model that the others have in common: what it foresees of a
    recording that it was not made of is what it is worth. jobs: by recording. work: diagnoses all of them."""
    from raccoon.diagnose.fleet.common_model import common_model, make_cross_check

    if len(fleet.names) > 1:
        return CommonModel(
            None, {}, f"the recordings are of {len(fleet.names)} robots, {', '.join(fleet.names)}"
        )
    names = [name for name, each in fleet.results.items() if each.model is not None]
    if not names:
        return CommonModel(None, {}, "this kind of recording gives no model of a robot")
    if len(names) == 1:
        return CommonModel(None, {}, f"only {names[0]} gives a model: name it alone")
    again = [replace(jobs[name], model=common_model(fleet, name)) for name in names]
    found = {
        name: make_cross_check(fleet.results[name], each.diagnosis)
        for name, each in zip(names, work(again), strict=True)
        if isinstance(each, Answer)
    }
    return CommonModel(common_model(fleet), found)


def save_common_model(path: Path, model: Parameters, fleet: Fleet) -> None:
    """Write the model with what it was made from, atomically."""
    from raccoon import __version__
    from raccoon.sim.effects.provenance import Provenance

    names = list(fleet.results)
    made = f"{len(names)} recordings, {names[0]} to {names[-1]}"
    program = f"raccoon diagnose {__version__}"
    replace(model, provenance=Provenance(made, program, date.today().isoformat(), "common")).save(path)
