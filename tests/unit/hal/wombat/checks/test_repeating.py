"""A back-EMF that repeats itself while its motor turns comes from no motor."""

import pytest

from raccoon.core.clock import SteppedClock
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_FROZEN_SECONDS, STOP, Fault, Outputs
from raccoon.hal.wombat.checks.repeat_watch import RepeatWatch
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters


def repeated(words: tuple[float, ...], seconds: float) -> RepeatWatch:
    watch, cycles = RepeatWatch(), round(seconds / 0.005)
    for cycle in range(cycles + 2):
        watch.update((600.0 + cycle % 3, *words), 5.0 + 0.005 * cycle)
    return watch


def test_it_is_said_of_the_motor_that_repeats_itself() -> None:
    assert repeated((700.0, -700.0, 0.0), BEMF_FROZEN_SECONDS - 0.01).frozen == (False,) * 4
    watch = repeated((700.0, -700.0, 0.0), BEMF_FROZEN_SECONDS + 0.01)
    assert watch.frozen == (False, True, True, False)
    watch.update((600.0, 700.0, -701.0, 0.0), 5.4)
    assert watch.frozen == (False, True, False, False)


def test_a_slow_wheel_and_one_that_was_not_looked_at_may_repeat_themselves() -> None:
    assert not any(repeated((60.0, -60.0, 25.0), 10.0).frozen)
    watch = RepeatWatch()
    for cycle in range(8):
        watch.update((700.0,) * 4, 0.5 * cycle)
    assert not any(watch.frozen)


def test_what_a_firmware_holds_because_it_measures_no_more_is_no_converter_that_stopped() -> None:
    watch = RepeatWatch(2000.0)
    for cycle in range(200):
        watch.update((1990.0, -1950.0, 1400.0, 0.0), 0.005 * cycle)
    assert watch.frozen == (False, False, True, False)


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_of_a_converter_that_stopped_no_word_is_handed_over_and_the_counter_has_jumped_after_it(
    firmware: Firmware,
) -> None:
    clock = SteppedClock()
    emulator = Emulator(SimulatedPlant(Parameters.from_robot(RobotConfig())), firmware, clock=clock)
    with WombatPort(emulator, clock=clock) as port:

        def run(outputs: Outputs, cycles: int) -> list[tuple[float | None, tuple[Fault, ...]]]:
            seen = []
            for _ in range(cycles):
                inputs = port.read()
                port.write(outputs)
                seen.append((inputs.position[1], inputs.faults))
            return seen

        healthy = run(Outputs((0.6, 0.6, 0.0, 0.0)), 160)
        assert not any(faults for _, faults in healthy[1:])
        emulator.faults.stopped_converters = {1}
        frozen = run(Outputs((0.6, 0.6, 0.0, 0.0)), 100)[-1]
        stands = run(STOP, 100)[-1]  # and it is no offset at rest
        assert frozen == stands == (None, (Fault.BEMF_FROZEN,))
        emulator.faults.stopped_converters = set()
        after = run(Outputs((0.6, 0.6, 0.0, 0.0)), 40)
    counting = [Fault.POSITION_JUMP in faults for position, faults in after if position is not None]
    assert counting[:2] == [True, False]
