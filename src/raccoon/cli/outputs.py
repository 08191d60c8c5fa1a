"""Checks of the files that a command is to write, made before the work begins."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from raccoon.core.config import is_model
from raccoon.core.errors import ConfigError
from raccoon.core.extras import install
from raccoon.core.files import is_stream, write_atomically
from raccoon.core.toml_text import parse_toml

PROTECTED_SUFFIXES = (".csv", ".gz", ".jsonl", ".mat", ".mcap", ".py", ".toml")
"""Endings of recordings, programs and robot descriptions, hours of work that no result may overwrite."""


def check_recording(path: Path) -> None:
    """Raise ConfigError if the recording of `--record` exists already, or cannot be written."""
    from raccoon.trace.record import existing_recording

    if path.is_dir():
        raise ConfigError(f"--record {path}: it is a folder; name a file")
    there = existing_recording(path)
    if there is not None:
        raise ConfigError(f"--record {there}: it already exists; choose another name")
    folder = next(each for each in path.absolute().parents if each.exists())  # missing folders are created
    if not (folder.is_dir() and os.access(folder, os.W_OK)):
        raise ConfigError(f"--record {path}: nothing can be written in {folder}")


def check_folders(*paths: Path | None) -> None:
    """Raise ConfigError if a file's folder does not exist, the path is a folder, the file cannot be written,
    or two results go to the same file. None: not requested."""
    asked = [path for path in paths if path is not None]
    for path in asked:
        if str(path) == "-":
            raise ConfigError("-: it is not a file name; for the standard output write /dev/stdout")
        if not path.absolute().parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent}")
        if path.is_dir():
            raise ConfigError(f"{path}: it is a folder; name a file")
        if not _can_be_written(path):
            raise ConfigError(f"{path}: nothing can be written there: no permission")
    for number, path in enumerate(asked):
        if any(_is_same_file(path, each) for each in asked[:number]):
            raise ConfigError(f"{path}: two results are to be written into it; name two files")


def check_matplotlib() -> None:
    """Raise ConfigError if matplotlib, an optional dependency, is missing, so that no pictures can be
    drawn."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise ConfigError(f"pictures need matplotlib: {install('report')} ({error})") from None


def check_not_read(outputs: Sequence[Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise ConfigError if an output would overwrite an input of the command. None: not requested."""
    read = [path for path in inputs if path is not None]
    for path in outputs:
        if path is not None and any(_is_same_file(path, each) for each in read):
            raise ConfigError(f"{path}: this command reads it; choose another name for what it writes")


def check_holdout(holdout: Iterable[Path], recordings: Iterable[Path]) -> None:
    """Raise ConfigError if a held-out recording is among the recordings to which the model is fitted."""
    fitted = list(recordings)
    for path in holdout:
        if any(_is_same_file(path, each) for each in fitted):
            raise ConfigError(
                f"--holdout {path}: it is also diagnosed, so it would only confirm itself; name another "
                "recording, or leave --holdout out: the part of it that no fit has seen is the test then"
            )


def check_replaceable(*paths: Path | None, model: Path | None = None) -> None:
    """Raise ConfigError if a result would overwrite a recording, a program or a robot.toml, or if `model`
    would overwrite a file that is not a model. None: not requested."""
    for path in paths:
        if path is not None and path.is_file() and path.suffix in PROTECTED_SUFFIXES:
            raise ConfigError(
                f"{path}: it already exists and does not have the name of a result; choose another name"
            )
    if model is not None and model.is_file() and not _is_model(model):
        raise ConfigError(
            f"{model}: it already exists and is not a model.toml; choose another name for the model"
        )


def _is_model(path: Path) -> bool:
    try:
        return is_model(parse_toml(path.read_bytes()))
    except ConfigError:
        return False


def _can_be_written(path: Path) -> bool:
    if is_stream(path):
        return os.access(path, os.W_OK)
    folder = Path(os.path.realpath(path)).parent
    return folder.is_dir() and os.access(folder, os.W_OK)


def _is_same_file(one: Path, other: Path) -> bool:
    """Whether two paths name the same file, also through links; never for devices, which take any number of
    results."""
    if is_stream(one):
        return False
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)


def save_figure(figure: Any, path: Path, **how: object) -> None:
    """Write a figure atomically to a file in the format that its ending names. how: arguments of
    `savefig`."""
    buffer = BytesIO()
    figure.savefig(buffer, format=path.suffix[1:], **how)
    write_atomically(path, buffer.getvalue())
