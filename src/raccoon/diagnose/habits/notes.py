"""Notes on the habits with which a recording was read, and on the ambiguity of its causes that follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from raccoon.core.readings import RACCOON_COASTS
from raccoon.diagnose.drives.ramp import Ramp
from raccoon.diagnose.findings.uncertainty import LATENCY, FitUncertainty
from raccoon.diagnose.findings.validation import MIN_DEVIATIONS
from raccoon.diagnose.habits.chains import CONTINUOUS_CYCLE_S, pauses_at_cycle_end
from raccoon.diagnose.habits.controller import SLOW_BATTERY_FILTERS_S
from raccoon.diagnose.habits.lags import GYRO_LATENCY
from raccoon.diagnose.habits.motor_driver import DEADBAND
from raccoon.diagnose.hypotheses.base_coordinates import LOW_PASS, LOW_PASS_DELAY, SAMPLE_PHASE_STD
from raccoon.diagnose.hypotheses.per_recording import BATTERY_RESISTANCE
from raccoon.diagnose.reports.cause_text import explanation_sentence
from raccoon.diagnose.result import CauseResult
from raccoon.diagnose.rollout.encoder_window import WINDOW
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.refits import GYRO_LOW_PASS, delay_same_reading
from raccoon.sim.effects.chain import Chain

MIN_NOTED_WINDOW_S = 0.004
"""Window of encoders in s from which it is noted: half of a shorter one would not matter as a latency."""
RESISTANCE_SHARE_BY_READ_TIME = 0.08
"""Standard deviation, relative to a battery's resistance, if it is unknown when in a row, and in which of a
motor's pauses, a reading was taken. The sag of a reversal decays with the wheels, in some 30 ms: by readings
from the beginning of a row of 5 ms a resistance was 16 % larger than by those from its end, where the
simulated ones are; by readings that see no pause it is a ninth larger."""
MAY_BE_READ_TIME = (
    "But it is not known exactly when in a row the reading is taken, which may explain all of it: change "
    "nothing because of this alone."
)
COMMAND_IN_FORCE_BEFORE = (
    "the readings show that each row holds the command in force until then, not from then on: each is "
    "simulated so"
)


def habit_notes(
    habits: Habits, causes: Sequence[CauseResult], uncertainty: FitUncertainty
) -> tuple[str, ...]:
    """Notes on how the log was read, if that is not the usual way, and on what it could be confused with."""
    known = () if habits.firmware is None else (_firmware_note(habits.firmware),)
    return (
        *known,
        *_controller_notes(habits, causes),
        *_encoder_notes(uncertainty),
        *_gyro_notes(habits, causes, uncertainty),
    )


def with_habit_uncertainty(
    causes: Sequence[CauseResult], habits: Habits, drifting: bool = False
) -> tuple[CauseResult, ...]:
    """Causes with increased standard deviations of the battery's resistance, of the latencies and of lags
    that may be latencies, since it is not known exactly when readings are taken. Their probability is limited
    to what the increased deviation allows, and if it may be the whole number the explanation says so:
    `validate_causes` named it from the drive alone.

    drifting: whether rows drift through the controller's cycles (`rows_drift`). A sample is then half a cycle
    old on average, not at a fixed age that may be 0; a clock of the controller's own has that age already.
    """
    firmware = habits.firmware if habits.knows_battery else None
    share = RESISTANCE_SHARE_BY_READ_TIME if firmware is None else firmware.unread_resistance_share
    unknown = {BATTERY_RESISTANCE[0]: (share, 0.0)}
    if habits.firmware is None:
        chip = 0.0 if habits.low_pass else 0.5 * LOW_PASS
        age = (2.0 if drifting and not habits.chain.free_running else 1.0) * SAMPLE_PHASE_STD
        unknown |= {LATENCY: (0.0, age), GYRO_LATENCY: (0.0, math.hypot(LOW_PASS_DELAY, chip))}
    sources = [reading_latency(each) or each.id for each in causes]
    return tuple(
        _with_wider_std(each, *unknown[source]) if source in unknown else each
        for each, source in zip(causes, sources, strict=True)
    )


def reading_latency(cause: CauseResult) -> str | None:
    """The latency that a cause is, or one of the same reading that it is not distinguished from: its time is
    then as uncertain as that latency. None if it is neither."""
    latencies = [each for each in (LATENCY, GYRO_LATENCY) if each in (cause.id, *cause.confounded_with)]
    return next((each for each in latencies if each == cause.id or delay_same_reading(cause.id, each)), None)


def _with_wider_std(cause: CauseResult, share: float, extra: float) -> CauseResult:
    """The cause with its one number's standard deviation increased by `share` of the number and by `extra`
    (root sum of squares)."""
    ((name, number),) = cause.parameters.items()
    std = math.hypot(number.std, share * number.value, extra)
    deviations = (number.value - number.nominal) / std
    most_probable = 1.0 if cause.confounded_with else 1.0 / (1.0 + math.exp(-0.5 * deviations**2))
    numbers = {name: replace(number, std=std)}
    words, rounded = (
        explanation_sentence(cause.id, cause.where, each) for each in (cause.parameters, numbers)
    )
    said = cause.explanation.replace(words, rounded)  # no more decimal places than are certain
    return replace(
        cause,
        explanation=said if abs(deviations) >= MIN_DEVIATIONS else f"{said} {MAY_BE_READ_TIME}",
        parameters=numbers,
        probability=min(cause.probability, most_probable),
    )


def _firmware_note(firmware: Firmware) -> str:
    """Note on the controller's known firmware."""
    if not firmware.wombat:
        return f"the recording is of {firmware.name}, whose filter is known; each row is treated as one cycle"
    zone = f", its dead zone of {firmware.dead_zone:g} counts" if firmware.dead_zone else ""
    return (
        f"the recording is of a Wombat with {firmware.name}: its filters, its clock, its sampling pauses of "
        f"{100.0 * firmware.chain.coast_share:.0f} % of the time{zone} are simulated as in its source code"
    )


def _controller_notes(habits: Habits, causes: Sequence[CauseResult]) -> tuple[str, ...]:
    """Notes on the controller's commands, samples and battery readings."""
    chain, notes = habits.chain, []
    if habits.commands_precede_rows:
        notes.append(COMMAND_IN_FORCE_BEFORE)
    if habits.ramp is not None:
        notes.append(_ramp_note(habits.ramp))
    if habits.swing_period:
        notes.append(
            f"the commands oscillate {1.0 / habits.swing_period:.1f} times a second, as in bang-bang line "
            "following, and react to disturbances before the wheels' readings show these: averages over "
            "whole oscillations are compared, which hide lags, filters and inertia; a drive of `raccoon "
            "excite` shows them"
        )
    if chain.battery_time_constant in SLOW_BATTERY_FILTERS_S:
        seconds = chain.battery_time_constant
        notes.append(
            f"the battery's reading has a filter of {seconds:g} s, as its sags show, and is simulated so; "
            "when in a row it is read is unknown, so a resistance is uncertain by "
            f"{100 * RESISTANCE_SHARE_BY_READ_TIME:.0f} %"
        )
    found_out = habits.firmware is None
    return (
        *notes,
        *(_sampling_notes(chain) if found_out else ()),
        *_motor_driver_notes(chain, causes),
        *_pause_notes(chain, causes, told=found_out),
    )


def _ramp_note(ramp: Ramp) -> str:
    """Note on a ramp between commands and motors, and its possible origin."""
    when, who = "", "a limit on how fast the power changes, in a program or a firmware"
    if ramp.soft:
        when, who = ", when the power increases", "a driver that starts softly"
    behind = f"as if a ramp of {ramp.rate:.3g} a second were between them{when}"
    return (
        f"the wheels follow the commands {behind}: this ramp is simulated, but is not in the "
        f"model that is written; is it {who}? Log what the motors are given"
    )


def _sampling_notes(chain: Chain) -> tuple[str, ...]:
    """Notes on when samples are taken."""
    notes = []
    if chain.cycle == CONTINUOUS_CYCLE_S:
        notes.append(
            "the wheels' readings lag as with a continuous filter and are simulated so: a filter with a step "
            "each 5 ms is 2 ms faster with the same time constant"
        )
    elif chain.cycle != Chain().cycle:
        notes.append(
            f"the wheels are simulated as read and filtered once in {1000.0 * chain.cycle:.3g} ms, as often "
            "as rows: at the usual 5 ms a filter of the same time constant is slower"
        )
    if chain.free_running:
        notes.append(
            "the controller is simulated with a clock of its own: readings are up to a cycle old in their "
            "row, and commands are up to a cycle old when it applies them"
        )
    return tuple(notes)


def _motor_driver_notes(chain: Chain, causes: Sequence[CauseResult]) -> tuple[str, ...]:
    """Notes on the motor driver's deadband and its current from the battery."""
    notes = []
    if DEADBAND in {each.name.partition("@")[0] for each in causes} and (chain.threshold or chain.cut):
        beyond = "act in full" if chain.threshold else "act reduced by the deadband"
        notes.append(f"commands beyond the deadband {beyond}, as the wheels show")
    if chain.whole:
        notes.append(
            "the battery is simulated as supplying the full current of both motors, as its sags show; with a "
            "PWM driver it would supply each current only while the PWM is on"
        )
    return tuple(notes)


def _pause_notes(chain: Chain, causes: Sequence[CauseResult], told: bool) -> tuple[str, ...]:
    """Notes on pauses in which motors coast to be sampled, or on what such pauses would change. told: whether
    to include what was found out of them, as without a known firmware."""
    notes = []
    if chain.pause and told:
        notes.append(
            "wheels are simulated as slower when they are read than on average, by half of what they lose "
            f"while their motor coasts for {1000.0 * chain.pause:.2g} ms before"
        )
    if pauses_at_cycle_end(chain):
        notes.append(
            f"motors are simulated as coasting for {100.0 * chain.coast_share:.0f} % of the time, during "
            "which their back-EMF is read; without that, a resistance that much higher than robot.toml's "
            "would give the same drive"
        )
    unpaused = 1.0 - chain.coast_share
    factors = [each.parameters["factor"] for each in causes if each.name == "motor.armature_resistance"]
    if chain.coast_share and any(abs(each.value - unpaused) < 2.0 * each.std for each in factors):
        notes.append(
            f"a resistance of {unpaused:g} times robot.toml's may also mean that the controller does not "
            "pause for its samples, or that robot.toml's value includes the pause already"
        )
    if not chain.coast_share and told:
        notes += [
            "motors are simulated as driven all of the time; if the controller lets them coast for "
            f"{100.0 * RACCOON_COASTS:.0f} % of it to read them, as a Wombat does, the drive is the same "
            f"with a resistance of {each.value * (1.0 - RACCOON_COASTS):.3g} times robot.toml's"
            for each in factors
            if each.value > 1.0
        ]
    return tuple(notes)


def _encoder_notes(uncertainty: FitUncertainty) -> tuple[str, ...]:
    """Note on the time over which encoders count."""
    window = uncertainty.settings.get(WINDOW, 0.0)
    if window < MIN_NOTED_WINDOW_S:
        return ()
    return (
        f"the encoders' speeds are simulated as means over {1000.0 * window:.2g} ms, so half of that late; "
        "without a gyro or a battery's reading, late commands look the same",
    )


def _gyro_notes(
    habits: Habits, causes: Sequence[CauseResult], uncertainty: FitUncertainty
) -> tuple[str, ...]:
    """Note on a gyro whose chip filters the turn rate."""
    if not habits.low_pass:
        return ()
    late = uncertainty.value_of((GYRO_LOW_PASS, None, "time_constant"))
    if GYRO_LATENCY not in {each.name for each in causes}:
        late += uncertainty.value_of((GYRO_LATENCY, None, "seconds"))
    return (
        f"the gyro lags by {1000.0 * late:.2g} ms: attributed to its chip's filter, which the Wombat's "
        "firmware sets to 41 Hz, and to readings that wait for their row; without a reference of the pose, "
        "wheels that slip by as much look the same",
    )
