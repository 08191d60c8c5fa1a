"""What is said of a reflectance sensor."""

from __future__ import annotations

from raccoon.diagnose.result import CauseResult, Gain, ParameterResult

AMBIENT, GAIN, HEIGHT, NOISE = "tophat.ambient_light", "tophat.gain", "tophat.height", "tophat.noise"
USUAL_NOISE = 5.0
"""Counts; a standing sensor has 2 to 5."""
NAMES = {AMBIENT: "offset", GAIN: "factor", HEIGHT: "height", NOISE: "sd"}


def tophat_cause(
    id_: str, port: int, number: ParameterResult, gain: Gain, rivals: tuple[str, ...]
) -> CauseResult:
    """The cause with its sentence."""
    value, base = number.value, number.nominal
    sentence = {
        AMBIENT: f"Light from outside shifts tophat {port} by {value - base:+.0f} counts: shade it, or "
        "calibrate where it is used.",
        GAIN: f"Tophat {port} reads {abs(value / max(base, 1e-9) - 1.0) * 100:.0f} % "
        f"{'more' if value > base else 'less'} than assumed: calibrate it on white and black.",
        HEIGHT: f"Tophat {port} sits {1000 * value:.1f} mm above the floor instead of {1000 * base:.1f} mm: "
        "mount it where it was meant to be, or calibrate it there.",
    }[id_]
    return CauseResult(id_, str(port), 1, {NAMES[id_]: number}, gain, 0.99, rivals, sentence)


def noise_cause(port: int, noise: float, assumed: float, error: float) -> CauseResult:
    """Too much noise. error: of the readings over the floor; naming the noise does not lower it."""
    sentence = (
        f"Tophat {port} is noisy: {noise:.0f} counts from reading to reading where {USUAL_NOISE:.0f} are "
        "usual: check its plug and wires, and average."
    )
    number = ParameterResult(noise, 0.1 * noise, "counts", assumed)
    return CauseResult(NOISE, str(port), 1, {"sd": number}, Gain(error, error, 0.0), 0.99, (), sentence)
