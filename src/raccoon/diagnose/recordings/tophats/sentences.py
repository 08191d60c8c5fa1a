"""Sentences and notes about a reflectance sensor."""

from __future__ import annotations

from raccoon.diagnose.reports.numbers import format_two_digits
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult
from raccoon.model.reflectance import FULL_SCALE

AMBIENT_LIGHT, GAIN, HEIGHT, NOISE = "tophat.ambient_light", "tophat.gain", "tophat.height", "tophat.noise"
RECALIBRATE_ADVICE = ("read white and black again in another light and at the height of the table",)
USUAL_NOISE_COUNTS = 5.0
"""Usual noise of a standing sensor, counts (2 to 5)."""
MILLIVOLTS_PER_COUNT, MILLIVOLT_TOLERANCE = 3300.0 / FULL_SCALE, 0.008
"""Millivolts per count of a 3.3 V converter, and tolerance of a gain on it within which readings may be
millivolts."""
PARAMETER_NAMES = {AMBIENT_LIGHT: "offset", GAIN: "factor", HEIGHT: "height", NOISE: "sd"}
"""Name of each cause's parameter in the catalogue."""


def tophat_cause(
    id_: str, port: int, number: ParameterResult, gain: Gain, rivals: tuple[str, ...], probability: float
) -> CauseResult:
    """The cause with its sentence."""
    value, base = number.value, number.nominal
    sentence = {
        AMBIENT_LIGHT: f"Light from outside shifts tophat {port} by {value - base:+.0f} counts: shade it, or "
        "calibrate where it is used.",
        GAIN: f"Tophat {port} reads {abs(value / max(base, 1e-9) - 1.0) * 100:.0f} % "
        f"{'more' if value > base else 'less'} than assumed: {_millivolts_hint(value)}calibrate it on white "
        "and black (raccoon calibrate tophats).",
        HEIGHT: f"Tophat {port} sits about {format_two_digits(1000 * value)} mm above the floor instead of "
        f"{format_two_digits(1000 * base)} mm: "
        "mount it where it was meant to be, or calibrate it there.",
    }[id_]
    return CauseResult(id_, str(port), 1, {PARAMETER_NAMES[id_]: number}, gain, probability, rivals, sentence)


def _millivolts_hint(gain: float) -> str:
    hint = "if the column is in millivolts, write counts (0..4095); else "
    return hint if abs(gain - MILLIVOLTS_PER_COUNT) < MILLIVOLT_TOLERANCE else ""


def describe_light(port: int, light: float, falls: tuple[float, float]) -> str:
    """Sentence on light that lowers the levels by these counts (white, black) by the sensor's model."""
    return (
        f"Light from outside, about {format_two_digits(100.0 * light)} % of direct sun, lowers tophat "
        f"{port} by {falls[0]:.0f} counts over white and {falls[1]:.0f} over black: shade it, or calibrate "
        "where it is used."
    )


def describe_light_offset(port: int, number: ParameterResult) -> str:
    """Note on the approximation of light by an offset."""
    moved = number.value - number.nominal
    return (
        f"analog.{port}: light lowers black more than white, and the offset of {moved:+.0f} counts is only "
        f"the mean of both, off by {number.std:.0f} on each: for the better model, set this light in the "
        "world; gain and height together would read the same"
    )


def describe_older_sensor(port: int) -> str:
    """Sentence on a sensor of the older make, if the simulation has the newer."""
    return (
        f"Tophat {port} reads like the older make of the sensor, which is darker over both surfaces, and "
        "most over white: calibrate it on white and black (raccoon calibrate tophats), and expect it to "
        "differ from newer ones."
    )


def describe_older_factor(port: int, number: ParameterResult) -> str:
    """Note on the approximation of a sensor of the older make by a factor."""
    return (
        f"analog.{port}: the simulated sensor is of the newer make, and the factor of {number.value:.2f} is "
        f"only the best fit, off by {number.std:.2f} on each surface; gain and height together, or light, "
        "would read the same"
    )


def describe_older_alternative(port: int, height: float) -> str:
    """Note on a sensor of the older make at another height that gives the same readings as the named
    cause."""
    return (
        f"analog.{port}: at about {format_two_digits(1000.0 * height)} mm a sensor of the older make reads "
        "the same: measure the height, or look at its make"
    )


def describe_fewer_bits(port: int, words: str, counts: float) -> str:
    """Note on readings that may be counts of fewer bits than the recording should have."""
    return (
        f"analog.{port}: it may hold {words} instead of counts of 12 bits (0..4095); then a smaller fault "
        f"would explain it: check what writes it and, if so, multiply by {counts:g} and diagnose again"
    )


def describe_unsure_surfaces(port: int, levels: tuple[float, float]) -> str:
    """Note on two unlabelled levels that no single cause explains and that may not be white and black."""
    return (
        f"analog.{port}: no single cause gives {levels[0]:.0f} and {levels[1]:.0f} counts, between which the "
        "readings do not alternate: it may be one surface in changing light; cross several lines, or record "
        f"truth.surface.{port}"
    )


def describe_saturation(port: int, clipped: tuple[int, int], causes: tuple[str, ...]) -> str:
    """Text on a clipped level, and what is then not identifiable. causes: those that fit the other level."""
    side, other = ("white", "black") if clipped[0] else ("black", "white")
    end = "4095, the largest value" if 1 in clipped else "0"
    ambiguity = f"; {other} alone cannot tell {' from '.join(causes)}" if len(causes) > 1 else ""
    return f"analog.{port} is saturated: {side} reads {end}, so its true value is unknown{ambiguity}"


def noise_cause(port: int, number: ParameterResult, error: float) -> CauseResult:
    """The cause of excessive noise. error: of the readings over the floor, which naming the noise does not
    reduce."""
    sentence = (
        f"Tophat {port} is noisy: {number.value:.0f} counts from reading to reading where "
        f"{USUAL_NOISE_COUNTS:.0f} are usual: check its plug and wires, keep it from flickering lamps, and "
        "average."
    )
    return CauseResult(NOISE, str(port), 1, {"sd": number}, Gain(error, error, 0.0), 0.99, (), sentence)


def rejection_reason(is_rival: bool) -> str:
    """Reason why a cause was not named. is_rival: whether it is listed as a rival of a named one."""
    if is_rival:
        return "it explains the levels as well as the named cause and is listed with it"
    return "another cause explains the levels better, or they are as assumed"
