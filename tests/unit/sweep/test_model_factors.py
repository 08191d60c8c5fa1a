"""A sweep of the robot that a diagnosis described."""

from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.provenance import Origin
from raccoon.sweep.factors import default_factors
from raccoon.sweep.match import Match
from raccoon.sweep.model_factors import factors_of_model
from raccoon.sweep.program import Program
from raccoon.sweep.runs import description

MODEL = (
    Parameters()
    .with_effect("drive.turn_scrub", torque=0.04)
    .with_effect("motor.back_emf_constant", "left", factor=0.94)
    .with_origin("motor.back_emf_constant", "left", Origin(std={"factor": 0.004}))
    .with_effect("friction.coulomb", torque=0.2)
    .with_effect("battery.open_circuit_voltage", voltage=6.5)
    .with_origin("battery.open_circuit_voltage", None, Origin(std={"voltage": 0.01}))
)


def test_what_was_found_is_as_sure_as_the_model_says_and_the_rest_is_as_usual() -> None:
    usual = {each.name: each for each in default_factors(RobotConfig())}
    found = {each.name: each for each in factors_of_model(RobotConfig(), MODEL)}
    left = found.pop("motor.back_emf_constant.factor@left")
    assert (round(left.low, 3), round(left.high, 3), left.normal) == (0.936, 0.944, True)
    gone = {"drive.turn_scrub.torque", "friction.coulomb.torque@left", "friction.coulomb.torque@right"}
    assert found == {
        name: each for name, each in usual.items() if name not in gone and each.name != left.name
    }  # the charge of the battery too: it is another one in each match


def test_a_match_is_played_by_the_model_with_what_was_drawn() -> None:
    match = Match(
        Program("p.py", "", "."), RobotConfig(), factors_of_model(RobotConfig(), MODEL), model=MODEL
    )
    values = match.values(3)
    robot = match.simulated_robot(values)
    assert robot.value("drive.turn_scrub", "torque") == 0.04
    assert (
        robot.value("motor.back_emf_constant", "factor", "left")
        == values["motor.back_emf_constant.factor@left"]
    )


def test_the_table_of_another_model_is_another() -> None:
    plain = Match(Program("p.py", "", "."), RobotConfig(), default_factors(RobotConfig()))
    assert "model" not in description(plain, 0)
    models = (MODEL, MODEL.with_effect("drive.turn_scrub", torque=0.05))
    digests = {
        description(Match(plain.program, plain.robot, plain.factors[:1], model=each), 0)["model"]
        for each in models
    }
    assert len(digests) == 2
