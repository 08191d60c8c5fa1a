"""Recordings that once went wrong, and what must be said of them: `python benchmarks/diagnosis_held.py`.

    python benchmarks/diagnosis_held.py [NAME ...]

A row each, "ok" or what was said instead, and the CPU time; exit status 1 where one is not ok. Nothing is
drawn at random. The tests hold shorter recordings of the same kinds; these are the ones that were seen, whose
searches take long. A NAME is a row, or the first part of its name, such as `chip`.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

import diagnosis_cases  # puts tests/blind on the path
from blind.generator import Noise, make
from blind.hidden import Hidden, draw, draw_unknown
from diagnosis_trial import diagnosed_columns
from raccoon import open_robot, seq, straight, wait
from raccoon.cli import main as raccoon
from raccoon.core.config import ControllerConfig, RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.rollout.firmware import Firmware, firmware_of
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.model_file import save_model
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.loading import load_run
from simulated_drives import record_simulated_drive

Columns = dict[str, NDArray[np.float64]]
Faults = dict[tuple[str, str | None], dict[str, float]]
ROBOT = RobotConfig()


@dataclass(frozen=True)
class Held:
    """One recording. causes: exactly those must be named, or be in the class of one that is; by_chance: and
    those may be. Beside causes, one that is reported as not mattering may be named too. unknown: on what
    something unknown must depend, or nothing. notes: words that some note must have. firmware: of the
    controller, if the recording names it."""

    name: str
    columns: Callable[[], Columns]
    causes: frozenset[str]
    unknown: str = ""
    notes: tuple[str, ...] = ()
    by_chance: frozenset[str] = frozenset()
    firmware: Firmware | None = None

    def faults(self, said: Diagnosis) -> Iterator[str]:
        """What is not as it must be."""
        named, unknown = {each.name for each in said.causes}, said.unexplained.depends_on
        classes = {other for each in said.causes for other in each.confounded_with}
        ignored = {each.name for each in said.causes if each.is_negligible and self.causes}
        if named - ignored - self.by_chance - self.causes or self.causes - named - classes:
            yield f"named {_listed(named)} instead of {_listed(self.causes)}"
        if self.unknown not in unknown if self.unknown else unknown:
            yield f"unknown over {_listed(unknown)} instead of {self.unknown or 'nothing'}"
        for words in self.notes:
            if not any(words in each for each in said.notes):
                yield f"no note has '{words}'"


def _listed(names: Collection[str]) -> str:
    return ", ".join(sorted(names)) or "nothing"


def main() -> None:
    """Every row that was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="rows; all where none is given")
    asked = parser.parse_args().names
    rows = [each for each in ROWS if not asked or any(each.name.startswith(name) for name in asked)]
    if not rows:
        parser.error(f"{', '.join(asked)}: allowed are {', '.join(each.name for each in ROWS)}")
    failed = 0
    for row in rows:
        columns, begin = row.columns(), time.process_time()
        faults = list(row.faults(diagnose(columns, ROBOT, firmware=row.firmware)))
        failed += bool(faults)
        print(f"{row.name:44s} {time.process_time() - begin:5.0f} s  {'; '.join(faults) or 'ok'}", flush=True)
    print(f"ok: {len(rows) - failed} of {len(rows)}")
    sys.exit(bool(failed))


PLAIN = Hidden("none", None, {}, {})
CHIP = Hidden("unknown", None, {}, {"gyro_smooth": 0.0039})
RIGID = Hidden("unknown", None, {}, {"bristle": 30000.0, "bristle_damping": 12.0})
SMOOTH = Hidden("unknown", None, {}, {"smooth": 0.08})
OWN_CLOCK = Hidden("unknown", None, {}, {"own_cycle": 0.0053, "gyro_smooth": 0.0039, "imu_latency": 0.0025})
LOOP = Hidden("unknown", None, {}, {**OWN_CLOCK.plant, "speed_loop": 0.0006})
STEERS = Hidden("unknown", None, {}, {"line_steer": 0.7, "own_cycle": 0.0053, "gyro_smooth": 0.0039})
SLIP = Hidden("drive.wheel_slip", None, {"time": 0.012}, {"slip": 0.012})
"""Robots of the independent plant, and wheels that slip by more than a gyro's chip smooths."""


def _blind(
    name: str,
    seed: int,
    *causes: str | Hidden,
    seconds: float = 16.0,
    robot: Hidden = PLAIN,
    drive: str = "exciting",
    size: float = 1.0,
    noise: float = 1.0,
    notes: tuple[str, ...] = (),
    by_chance: tuple[str, ...] = (),
) -> Held:
    """A robot of the independent plant, with causes that are drawn from the same seed or given."""
    rng = np.random.default_rng(seed)
    hidden = [each if isinstance(each, Hidden) else draw(each, rng, size) for each in causes]

    def columns() -> Columns:
        return dict(make(seed, [robot, *hidden], drive, seconds, Noise().times(noise)).columns)

    return Held(name, columns, frozenset(each.name for each in hidden), "", notes, frozenset(by_chance))


def _tabled(name: str, key: str, seed: int, *relevant: str) -> Held:
    """A recording of the table of benchmarks/diagnosis.py. relevant: what must be named, if not all that is
    hidden."""
    case = diagnosis_cases.Case.of(key)
    hidden = frozenset(each.name for each in diagnosis_cases.hidden_causes(case, case.rng(seed)))
    asked = frozenset(relevant) or hidden

    def columns() -> Columns:
        return dict(diagnosed_columns(case, diagnosis_cases.make_recording(case, seed)))

    return Held(name, columns, asked, by_chance=hidden - asked)


def _unknown(name: str, kind: str, depends_on: str) -> Held:
    """Something of no catalogue."""
    hidden = draw_unknown(kind, np.random.default_rng(1))
    return Held(name, lambda: dict(make(1, [hidden], seconds=24.0).columns), frozenset(), depends_on)


def _written_late(name: str, *causes: str) -> Held:
    """A logger that writes what it has just done, beside readings of now. Without a cause they may fit all
    the same, and nobody asks."""
    hidden = [draw(each, np.random.default_rng(3)) for each in causes]

    def columns() -> Columns:
        found = dict(make(4, hidden, seconds=10.0).columns)
        for port in (0, 1):
            duty = found[f"motor.{port}.duty"]
            found[f"motor.{port}.duty"] = np.concatenate([duty[:1], duty[:-1]])
        return found

    return Held(name, columns, frozenset(causes), notes=("in force until then",) if causes else ())


def _simulated(
    name: str, robot: Parameters, seconds: float, *causes: str, seed: int = 3, notes: tuple[str, ...] = ()
) -> Held:
    """The package's own robot, in a drive that shows everything."""
    return Held(name, lambda: record_simulated_drive(robot, seconds, seed), frozenset(causes), notes=notes)


def _legs_at_one_speed(name: str) -> Held:
    """A sound robot under its speed loop, which answers what a reading was off by within 20 ms."""

    def columns() -> Columns:
        with tempfile.TemporaryDirectory() as folder:
            run = Path(folder) / "run.jsonl.gz"
            with open_robot(
                replace(ROBOT, controller=ControllerConfig(port="sim")), record=run, seed=0
            ) as robot:
                robot.run(seq(wait(1.0), straight(1.5, 0.3), straight(-1.5, 0.3), wait(1.0)))
            return dict(load_run(run).recording.columns)

    return Held(name, columns, frozenset(), firmware=firmware_of(SIMULATOR))


def _checked_up(name: str, faults: Faults) -> Held:
    """`raccoon excite --simulate` of a robot with these faults."""

    def columns() -> Columns:
        with tempfile.TemporaryDirectory() as folder:
            robot, model, run = (Path(folder) / each for each in ("robot.toml", "model.toml", "run.jsonl.gz"))
            robot.write_text('[controller]\nport = "wombat"\n')
            save_model(Parameters(ROBOT, faults), model)
            words = ["--robot", str(robot), "--simulate", "--model", str(model), "--record", str(run)]
            with contextlib.redirect_stdout(io.StringIO()):
                if status := raccoon(["excite", *words]):
                    raise SystemExit(f"raccoon excite: exit status {status}")
            return dict(load_run(run).recording.columns)

    return Held(name, columns, frozenset(id_ if side is None else f"{id_}@{side}" for id_, side in faults))


CREEPS: Faults = {("friction.presliding", None): {"creep": 0.08, "creep_tail": 1.0}}
GIVES: Faults = {("friction.presliding", None): {"compliance": 0.001, "damping": 0.3}}
HEAVY: Faults = {("drive.inertia", None): {"factor": 1.4}}
CLOCK = ("clock of its own",)
SLOPE = ("drive.slope",)
"""A few stops' chance away where there is twice the noise."""
ROWS = (
    _blind("clean/12 s, a late wheel", 49, seconds=12.0),
    _blind("clean/12 s, a floor that wanders", 37, seconds=12.0),
    _blind("clean/30 s", 5, seconds=30.0),
    _blind("two/slip, gyro bias", 4, "drive.wheel_slip", "imu.gyro_bias"),
    _blind("two/viscous friction, late gyro", 4, "friction.viscous", "imu.latency"),
    _blind("two/backlash, slip", 4, "drive.backlash", "drive.wheel_slip"),
    _tabled("play/battery", "two/two/4", 1901990017),
    _tabled("play/latency, deadband and others", "several/several/0", 1901990017),
    _tabled(
        "crowd/a lag that is half of two",
        "everything/everything/4",
        2131738100,
        *(
            "friction.quadratic",
            "actuation.deadband",
            "drive.wheel_slip",
            "bemf.scale@right",
            "drive.backlash",
        ),
    ),
    _blind("two/offset, gyro drift", 6, "bemf.offset", "imu.gyro_drift"),
    _blind(
        "four",
        6,
        *("battery.discharge", "actuation.latency", "drive.turn_scrub", "imu.gyro_bias"),
        seconds=18.0,
    ),
    _blind("small/late gyro", 8, "imu.latency", size=0.3, seconds=22.0),
    _blind(
        "friction that stops wheels",
        519595171,
        Hidden("friction.coulomb", None, {"torque": 0.2309}, {"coulomb": 0.2309}),
        seconds=30.0,
    ),
    *(
        _blind(
            f"dead zone, twice the noise/{seed}",
            seed,
            "bemf.dead_zone",
            size=0.2,
            noise=2.0,
            seconds=25.0,
            by_chance=SLOPE,
        )
        for seed in range(5, 8)
    ),
    _unknown("unknown/gyro over speed", "gyro_speed", "gyro over speed"),
    _unknown("unknown/payload", "payload", "time (inertia)"),
    _blind("rigid friction/clean", 6, robot=RIGID),
    _blind("rigid friction/battery", 6, "battery.internal_resistance", robot=RIGID),
    _blind("rigid friction/scrub", 6, "drive.turn_scrub", robot=RIGID),
    _blind("smooth friction/clean", 8, robot=SMOOTH),
    _blind("smooth friction/Coulomb", 8, "friction.coulomb", robot=SMOOTH),
    _simulated("rigid friction/simulated", Parameters(ROBOT, {}, Chain.firmware()), 20.0),
    _simulated("creeping friction/simulated", Parameters(ROBOT, CREEPS, Chain.firmware()), 20.0),
    _blind("chip/late gyro", 8, "imu.latency", robot=CHIP),
    _blind("chip/viscous friction", 8, "friction.viscous", robot=CHIP, notes=("41 Hz",)),
    _blind("chip/K_E", 8, "motor.back_emf_constant", robot=CHIP, notes=("41 Hz",)),
    _blind("chip/slip, K_E", 8, SLIP, "motor.back_emf_constant", robot=CHIP),
    _blind("own clock/clean", 8, robot=OWN_CLOCK, notes=CLOCK),
    _blind("own clock/scrub", 8, "drive.turn_scrub", robot=OWN_CLOCK, notes=CLOCK),
    _blind("own clock/speed loop, K_E", 13, "motor.back_emf_constant", robot=LOOP, notes=CLOCK),
    _blind(
        "own clock/line, battery, offset",
        2,
        *("battery.internal_resistance", "bemf.offset"),
        robot=STEERS,
        drive="legs",
        notes=("times a second",),
    ),
    _simulated("median without slots/clean", Parameters(ROBOT, GIVES, Chain(median=True)), 12.0, seed=1),
    _simulated(
        "simulator's chain/deadband",
        Parameters(ROBOT, {("actuation.deadband", None): {"duty": 0.066}}, Chain()),
        12.0,
        "actuation.deadband",
        seed=1,
    ),
    _simulated(
        "creeping friction/inertia",
        Parameters(ROBOT, HEAVY | CREEPS, Chain.firmware()),
        20.0,
        "drive.inertia",
    ),
    _written_late("commands of the row before/clean"),
    _written_late("commands of the row before/inertia", "drive.inertia"),
    _legs_at_one_speed("speed loop/legs at one speed"),
    _checked_up(
        "checkup/three faults",
        {
            ("motor.armature_resistance", "left"): {"factor": 1.2},
            ("bemf.dead_zone", None): {"counts": 60.0},
            ("imu.gyro_drift", None): {"rate_per_second": 0.001},
        },
    ),
)

if __name__ == "__main__":
    main()
