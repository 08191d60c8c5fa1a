"""Suggestions for the next recording or measurement: drives that separate confounded causes, or show what was
not visible."""

from __future__ import annotations

from collections.abc import Mapping

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.findings.cause_results import INDISTINGUISHABLE_CLASSES
from raccoon.diagnose.findings.rejections import BEMF_PREFIX, EFFECTS_BY_CHANNEL, sides_without_bemf
from raccoon.diagnose.reports.manoeuvre_text import manoeuvre_for
from raccoon.diagnose.result import CauseResult
from raccoon.diagnose.select.detection_limits import MIN_VISIBLE_EVIDENCE
from raccoon.diagnose.select.refits import SHARED_SCALE_CAUSES
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.parameters import SIDES

BENCH_ADVICE = (
    f"no drive tells {', '.join(SHARED_SCALE_CAUSES[:-1])} and {SHARED_SCALE_CAUSES[-1]} apart: "
    "measure the winding of an unplugged motor with an ohmmeter, or weigh the robot, "
    "and write that into robot.toml with its std"
)
"""Advice for causes on the common scale: power steps, which show each of the four, show all of them at
once."""


def suggest_manoeuvres(
    search: Search, causes: tuple[CauseResult, ...], log: Log, visible: Mapping[str, float]
) -> tuple[str, ...]:
    """Manoeuvres that separate confounded causes, unless they do not matter, and that show what was not
    visible in this recording.

    visible: see `effect_visibility`.
    """
    doubtful = [each for each in causes if not each.is_negligible]  # no drive is worth what does not matter
    commands = [_separating_command(search, each.name, each.confounded_with) for each in doubtful]
    scale_causes = [each for each in doubtful if _is_scale_ambiguity(each)]
    commands += [BENCH_ADVICE for _ in scale_causes]
    wanted = [each.id for each in doubtful if each.confounded_with and each not in scale_causes]
    hidden = sorted((power, id_) for id_, power in visible.items() if power < MIN_VISIBLE_EVIDENCE)
    gone = {
        id_ for id_ in visible if id_.startswith(BEMF_PREFIX) and len(sides_without_bemf(log)) == len(SIDES)
    }
    gone |= {id_ for role, ids in EFFECTS_BY_CHANNEL.items() if log.channel(role) is None for id_ in ids}
    wanted.extend(id_ for _, id_ in hidden if id_ not in gone)
    texts = [text for text in (*commands, *map(manoeuvre_for, wanted)) if text is not None]
    return tuple(dict.fromkeys(texts))[:3]


def _is_scale_ambiguity(cause: CauseResult) -> bool:
    """Whether all rivals of a cause are on the common scale, from which no drive distinguishes it."""
    return bool(cause.confounded_with) and {cause.name, *cause.confounded_with} <= set(SHARED_SCALE_CAUSES)


def _separating_command(search: Search, name: str, rivals: tuple[str, ...]) -> str | None:
    """The command for the drive that separates a cause from its nearest rival; None if it has none, if no
    drive distinguishes them, and for a team's own effect."""
    separable = (
        each.name
        for each in search.rivals.get(name, [])
        if each.name in rivals
        and each.name in search.problem.causes
        and not each.together
        and not any({name, each.name} <= alike for alike in INDISTINGUISHABLE_CLASSES)
    )
    nearest = next(separable, None)
    if nearest is None or any(search.problem.causes[each].own is not None for each in (name, nearest)):
        return None
    command = f"raccoon excite --cause {name} --rival {nearest} --record again.jsonl"
    return f"{command}: the drive that best tells {name} from {nearest} on this robot"
