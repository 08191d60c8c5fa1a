"""The public names are where they are said to be."""

import pytest

import raccoon


def test_every_public_name_exists() -> None:
    for name in raccoon.__all__:
        assert getattr(raccoon, name) is not None, name


def test_the_lazy_table_and_the_list_agree() -> None:
    assert sorted(raccoon.__all__) == list(raccoon.__all__)
    assert set(raccoon._HOME_OF) | {"deg"} == set(raccoon.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="drive_staight"):
        getattr(raccoon, "drive_staight")  # noqa: B009 - the typing mistake is the test
