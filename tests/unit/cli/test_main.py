"""The command line itself: help, version, mistakes, Ctrl-C."""

import argparse
import errno
import os
import runpy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import raccoon
from raccoon import __version__
from raccoon.cli import main
from raccoon.cli.commands import COMMANDS, build_parser
from raccoon.cli.crew import open_crew


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert not end.value.code
    shown = capsys.readouterr().out
    assert all(name.replace("_", "-") in shown for name in COMMANDS)


def test_commands_are_listed_in_order() -> None:
    assert sorted(COMMANDS) == list(COMMANDS)


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"raccoon {__version__}\n"


def test_without_a_command_all_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    said = capsys.readouterr()
    assert all(name.replace("_", "-") in said.err for name in COMMANDS)
    assert said.out == ""


@pytest.mark.parametrize("command", ["replay", "diagnose", "calibrate drive", "calibrate tophats"])
def test_an_empty_name_is_not_the_folder_that_one_is_in(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A variable of a script that is empty: every recording here was replayed."""
    with pytest.raises(SystemExit) as end:
        main([*command.split(), ""])
    assert end.value.code == 2
    assert "the name of a recording is empty" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nonsense"], "there is no 'nonsense'; allowed are calibrate, compare-mitigations, "),
        (["calibrat", "drive"], "there is no 'calibrat' (did you mean calibrate?); allowed are "),
        (
            ["calibrate", "driv"],
            "KIND: there is no 'driv' (did you mean drive?); allowed are drive, motors, ",
        ),
        (["help", "diagnos"], "there is no 'diagnos' (did you mean diagnose?); allowed are "),
        (["demo", "--nonsense"], "raccoon demo: there is no option --nonsense; see raccoon demo --help\n"),
        (["view", "a", "--outptu=b"], "there is no option --outptu (did you mean --output?); see raccoon "),
        (
            ["sweep", "--rusn=5"],
            "no option --rusn (did you mean --runs?); the following arguments are required: program; ",
        ),
        (["sweep", "--run=5", "-x"], "raccoon sweep: there is no option -x; the following arguments are req"),
        (["sweep", "--runs=x", "--", "--y"], "raccoon sweep: argument --runs: 'x' is not a whole number; "),
        (["sweep", "--start", "-1", "-.5", "--y z"], "sweep: argument --start: '--y z' is not a number; "),
        (
            ["calibrate", "--robot=r.toml"],
            "raccoon calibrate: the following arguments are required: KIND; ",
        ),
        (["view", "a", "b", "c", "d"], "raccoon view: too many arguments: c d; "),
        (["sweep", "a.py", "--runs", "3.5"], "argument --runs: '3.5' is not a whole number; "),
    ],
)
def test_wrong_usage_is_status_2_and_says_what_is_near(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    shown = capsys.readouterr().err
    assert said in shown
    assert shown.startswith("raccoon")  # nothing before the sentence, such as ten lines of usage
    assert shown.count("\n") == 1


@pytest.mark.parametrize("command", [(), ("diagnose",), ("calibrate", "drive")])
def test_help_before_a_command_is_help_behind_it(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    shown = []
    for arguments in (["help", *command], [*command, "--help"]):
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert not end.value.code
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]
    assert shown[0].startswith(" ".join(("usage: raccoon", *command)))


def test_ctrl_c_is_status_130(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("raccoon.cli.init.run", interrupted)
    assert main(["init", "-"]) == 130
    assert capsys.readouterr().err == "raccoon init: interrupted\n"


def test_an_interruption_while_the_commands_are_found_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("raccoon.cli.init.configure", interrupted)
    assert main(["init"]) == 130
    assert capsys.readouterr().err == "raccoon: interrupted\n"


@pytest.mark.parametrize("wrapped", [False, True], ids=["plain", "in the middle of a class"])
def test_an_interruption_while_modules_are_loaded_is_one_line(
    wrapped: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupted:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "raccoon.cli.commands":
                ctrl_c = KeyboardInterrupt()
                if wrapped:
                    raise RuntimeError("Error calling __set_name__") from ctrl_c
                raise ctrl_c

    monkeypatch.delitem(sys.modules, "raccoon.cli.commands")
    monkeypatch.setattr(sys, "meta_path", [Interrupted(), *sys.meta_path])
    assert main(["init"]) == 130
    assert capsys.readouterr().err == "raccoon: interrupted\n"


def test_nothing_is_loaded_before_ctrl_c_is_heeded() -> None:
    """What is imported until then ends in a traceback; these alone take 20 ms, and 0.1 s on a Pi."""
    path = str(Path(raccoon.__file__).parents[1])
    code = f"import sys; sys.path.append({path!r}); import raccoon.cli; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True)
    assert not {"argparse", "typing", "pathlib", "re", "raccoon.core.errors"} & set(done.stdout.split())


def test_closed_outputs_do_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`raccoon init - 2>&-`, `raccoon effects >&-`: Python has None for them, which writes nothing."""
    for name in ("stderr", "stdout"):
        monkeypatch.setattr(sys, name, None)
    assert main(["init", "-"]) == 0
    assert main(["doctor", "--port", "sim", "--robot", str(tmp_path / "no.toml")]) == 2
    assert capsys.readouterr() == ("", "")
    for name in ("stderr", "stdout"):
        getattr(sys, name).close()


def _arguments(parser: argparse.ArgumentParser, name: str) -> Iterator[tuple[str, argparse.Action]]:
    """Every argument of a command and of its sub-commands, with what it is called in the help."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for word, command in action.choices.items():
                yield from _arguments(command, f"{name} {word}")
        elif not isinstance(action, argparse._HelpAction):
            yield f"{name} {' '.join(action.option_strings) or action.dest}", action


def test_the_help_tells_what_every_argument_is() -> None:
    arguments = dict(_arguments(build_parser(), "raccoon"))
    assert "raccoon calibrate drive --tape" in arguments
    assert not [name for name, each in arguments.items() if not each.help]


def test_what_several_commands_ask_has_one_name() -> None:
    """How many processes to use was --jobs, --processes and --workers."""
    parser = build_parser()
    (commands,) = (each for each in parser._actions if isinstance(each, argparse._SubParsersAction))
    asked = {
        name: {each.option_strings[0] for each in command._actions if "processes" in (each.help or "")}
        for name, command in commands.choices.items()
    }
    assert asked["demo"] == asked["compare-mitigations"] == {"--workers"}
    assert set().union(*asked.values()) == {"--workers", "--executor"}


def test_no_number_of_workers_is_one_for_each_core(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int | None] = []
    monkeypatch.setattr("raccoon.sweep.workers.process_crew", asked.append)
    for workers in (0, 3):
        open_crew(argparse.Namespace(executor="processes", scheduler=None, workers=workers))
    assert asked == [None, 3]


def test_init_writes_a_file_that_can_be_read_and_never_overwrites(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from raccoon import load_robot

    path = tmp_path / "robot.toml"
    assert main(["init", str(path)]) == 0
    assert "raccoon simulate PROGRAM" in capsys.readouterr().out
    assert load_robot(path).name == "robot"
    before = path.read_text(encoding="utf-8")
    assert main(["init", str(path)]) == 2
    assert "exists and is left as it is" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == before
    assert [each.name for each in tmp_path.iterdir()] == ["robot.toml"]


@pytest.mark.parametrize(
    "command", [["demo"], ["tune", "wheels"], ["calibrate", "motors"], ["compare-mitigations"]]
)
def test_a_seed_is_not_negative(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command, "--seed", "-1"]) == 2
    said = f"raccoon {command[0]}: --seed -1: allowed are whole numbers from 0\n"
    assert capsys.readouterr().err == said


def test_a_file_without_a_folder_is_named_as_it_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for command in (["init", "a/b.toml"], ["convert", "run.csv", "a/b.csv"]):
        assert main(command) == 2
        said = f"raccoon {command[0]}: {command[-1]}: there is no folder a\n"
        assert capsys.readouterr().err == said


def test_bad_input_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--workers", "-1"]) == 2
    assert capsys.readouterr().err == "raccoon demo: --workers -1: allowed are whole numbers from 0\n"


def test_an_output_that_takes_nothing_more_is_one_plain_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("raccoon.cli.init.run", full)
    assert main(["init", "-"]) == 2
    assert capsys.readouterr().err == "raccoon init: no space left on device\n"


def test_a_file_whose_name_is_no_text_can_be_spoken_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / os.fsdecode(b"b\xe4d.csv")
    path.write_text("t,motor.0.bemf,motor.1.bemf\n0,0,0\n0.1,0,0\n")
    assert main(["replay", str(path)]) == 0
    assert "b\\udce4d.csv" in capsys.readouterr().out


def test_a_path_through_a_file_is_one_clear_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes").write_text("", encoding="utf-8")
    path = tmp_path / "notes" / "robot.toml"
    assert main(["tune", "wheels", "--robot", str(path)]) == 2
    assert capsys.readouterr().err == f"raccoon tune: {path}: not a directory\n"


def test_a_file_that_is_not_there_is_named_and_how_to_make_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["excite"]) == 2
    assert capsys.readouterr().err == (
        "raccoon excite: robot.toml: no such file or directory; `raccoon init` writes a template, --robot "
        "names another file\n"
    )
    assert main(["diagnose", "run.csv"]) == 2
    assert capsys.readouterr().err == "raccoon diagnose: run.csv: there is no such recording\n"
    Path("run.jsonl").touch()
    assert main(["diagnose", "rnu.jsonl"]) == 2
    assert capsys.readouterr().err.endswith("there is no such recording (did you mean run.jsonl?)\n")
    assert main(["view", "rnu.jsonl"]) == 2
    assert capsys.readouterr().err.endswith("no such file or directory (did you mean run.jsonl?)\n")


@pytest.mark.parametrize(
    "command",
    [
        ["view", "run.csv"],
        ["calibrate", "drive", "run.csv"],
        ["calibrate", "motors"],
        ["calibrate", "tophats"],
        ["tune", "wheels"],
    ],
)
def test_an_option_that_is_not_there_is_told_with_the_help_of_its_command(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main([*command, "--outptu=a.svg"])
    assert end.value.code == 2
    said = capsys.readouterr().err
    name = " ".join(word for word in command if word != "run.csv")
    assert said.startswith(f"raccoon {name}: there is no option --outptu")
    assert said.endswith(f"see raccoon {name} --help\n")


def test_init_names_the_file_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was its own temporary one, of which nobody had heard."""

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted", "its own", None, "robot.toml")

    monkeypatch.setattr(os, "link", refuse)
    path = tmp_path / "robot.toml"
    assert main(["init", str(path)]) == 2
    assert capsys.readouterr().err == f"raccoon init: {path}: operation not permitted\n"
    assert not list(tmp_path.iterdir())


def test_the_package_itself_is_the_command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["raccoon", "init", "-"])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("raccoon", run_name="__main__")
    assert end.value.code == 0
    assert "[controller]" in capsys.readouterr().out
