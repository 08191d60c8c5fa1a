"""`raccoon diagnose --save-model` for several recordings: the model that they have in common, and its
cross-check."""

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
    """The common model of a fleet, or None with the `reason`. foreseen: for each recording, the cross-check
    of the model that the others have in common."""

    model: Parameters | None
    foreseen: Mapping[str, CrossCheck]
    reason: str = ""


def make_common_model(
    fleet: Fleet, jobs: Mapping[str, Job], work: Callable[[list[Job]], Sequence[Answer | str]]
) -> CommonModel:
    """Make the common model and cross-check it: each recording is diagnosed again from the common model of
    the others, since a model is worth what it predicts about recordings it was not made from.

    jobs: by recording. work: diagnoses a list of jobs.
    """
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
    """Write the model with its provenance to a file, atomically."""
    from raccoon import __version__
    from raccoon.sim.effects.provenance import Provenance

    names = list(fleet.results)
    made = f"{len(names)} recordings, {names[0]} to {names[-1]}"
    program = f"raccoon diagnose {__version__}"
    replace(model, provenance=Provenance(made, program, date.today().isoformat(), "common")).save(path)
