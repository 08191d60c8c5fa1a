"""`raccoon effects`: the catalogue as a list, as JSON and as a page."""

import json
from pathlib import Path

import numpy as np
import pytest

from raccoon.cli.effects.page import figure_of
from raccoon.cli.effects.recordings import comparison
from raccoon.cli.main import main
from raccoon.sim.effects.effect import all_effects

ROOT = Path(__file__).resolve().parents[3]


def test_it_lists_every_effect_with_its_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects"]) == 0
    printed = capsys.readouterr().out
    for each in all_effects():
        assert each.id in printed
        assert each.sentence in printed


def test_a_group_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "motor", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {each["group"] for each in rows} == {"motor"}
    limit = next(each for each in rows if each["id"] == "motor.current_limit")
    assert limit["parameters"][0]["neutral"] is None


def test_an_unknown_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "magic"]) == 2
    assert "groups are battery, motor" in capsys.readouterr().err


@pytest.mark.parametrize("entry", all_effects(), ids=lambda each: each.id)
def test_every_effect_shows_in_a_recording(entry: object) -> None:
    shown = comparison(entry)  # type: ignore[arg-type]
    assert abs(shown.without - shown.with_effect).max() > 1e-3


@pytest.mark.parametrize("name", ["imu.gyro_bias", "imu.gyro_drift"])
def test_a_picture_shows_an_effect_that_its_channel_hides(name: str) -> None:
    """A drift of 0.01 rad/s beside turns of 1.5 is thinner than the line."""
    entry = next(each for each in all_effects() if each.id == name)
    above, below = figure_of(comparison(entry)).axes
    low, high = below.get_ylim()
    assert high - low < 0.05 * (above.get_ylim()[1] - above.get_ylim()[0])
    assert np.ptp(below.get_lines()[-1].get_ydata()) < high - low
    assert low < 0.0 < high


def test_the_page_is_the_one_of_this_catalogue() -> None:
    page = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    for each in all_effects():
        assert f"### `{each.id}`" in page
        assert each.sentence in page
        assert (ROOT / "docs" / "effects" / f"{each.id}.png").exists()


def test_the_page_needs_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["friction"], ["--json"]):
        assert main(["effects", *words, "--write", str(tmp_path)]) == 2
        assert f"it writes the page of all effects; leave out {words[0]}" in capsys.readouterr().err
    assert main(["effects", "--write", str(tmp_path / "nowhere")]) == 2
    assert "no such folder" in capsys.readouterr().err
