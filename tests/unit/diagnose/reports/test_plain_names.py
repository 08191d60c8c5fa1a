from __future__ import annotations

from raccoon.diagnose.reports.plain_names import PLAIN_NAMES, capitalise, plain_name
from raccoon.sim.effects.catalogue import CATALOGUE


def test_every_effect_has_a_plain_name_of_its_own() -> None:
    assert PLAIN_NAMES.keys() == CATALOGUE.keys()
    assert len(set(PLAIN_NAMES.values())) == len(PLAIN_NAMES)


def test_a_plain_name_says_where() -> None:
    assert plain_name("friction.coulomb@left") == "dry friction (left)"
    assert plain_name("tophat.gain@2") == "gain of a tophat (port 2)"
    assert plain_name("battery.internal_resistance") == "battery resistance"
    assert plain_name("team.motor_hum@left") == "team.motor_hum (left)"


def test_the_name_of_a_column_begins_a_sentence_as_it_is() -> None:
    assert (
        capitalise("motor.0.bemf stays at 511: it is cut off.") == "motor.0.bemf stays at 511: it is cut off."
    )
    assert capitalise("dry friction. It rubs.") == "Dry friction. It rubs."
    assert capitalise("") == ""
