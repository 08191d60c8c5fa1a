"""One step of the Kalman filters of `hypotheses`, for the banks of several sensors at once.

Arrays have the axes moment, bank and mode (or transition). Moments of a mode: probability; u, v, the light's
pace (per reading); their covariance uu, uv, vv, up, vp, pp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat.modes import (
    BORDER_MODES,
    MODES,
    OTHER_FLOOR_MODE,
    STAGES,
    mode_transitions,
)
from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

OUTLIER_DENSITY = 1e-6  # density of an outlier, in units of 1 / the least u
# light of another floor over u, mean and sd: boards are darker, glare is brighter
OTHER_FLOOR_RATIO = 1.2, 0.6
MIN_FLOOR_RATIO = 0.5  # least light of another floor, as a share of u; boards have 0.65 and more
FLOOR_RETURN_SD = 0.03  # sd of the light of a floor that returns, as a share of its former light
# Rows of the three products of u, of v and of the pace with each of them, in what `_predict` returns
U_ROWS, V_ROWS, PACE_ROW = slice(0, 3), slice(3, 6), 6
COVARIANCE_ROWS = [0, 1, 4, 2, 5, 6]  # uu, uv, vv, up, vp, pp in these


class BankConstants(NamedTuple):
    """Constants of the banks, each with the axes bank and mode.

    black_share to noise: see `hypotheses.Sensor`. start_: levels at the start of the bank; former_: levels
    that may return with the floor. light_read: light of the reading.
    """

    black_share: Array
    black_share_sd: Array
    least_light: Array
    least_dark: Array
    pattern: Array
    noise: Array
    start_light: Array
    start_dark: Array
    start_dark_var: Array
    former_light: Array
    former_light_var: Array
    former_dark: Array
    former_dark_var: Array
    light_read: Array


def advance_modes(modes: Array, constants: BankConstants, probability: Array) -> Array:
    """The moments of all modes after a reading. probability: of each transition, with the axes bank and
    transition."""
    transitions, light_read = mode_transitions(), constants.light_read
    sources = _with_floor_modes(modes, constants).take(transitions.predictions.source, axis=2)
    predicted = _predict(sources, constants).take(transitions.prediction, axis=2)
    means, covariance = predicted[1:4], predicted[4:]
    light, dark, _ = means
    # Update: the reading mixes white and black by their parts of the spot.
    a, b = transitions.white_part, transitions.black_part
    to_means = a * covariance[U_ROWS]
    to_means += b * covariance[V_ROWS]
    converter_noise = constants.noise / FULL_SCALE * (1.0 + light_read) ** 2
    noise = (constants.pattern * light_read) ** 2 + converter_noise**2
    blur = transitions.blur * (light - dark)
    variance = a * to_means[0] + b * to_means[1] + noise + blur * blur
    innovation = light_read - a * light - b * dark
    inverse = 1.0 / variance
    scaled = innovation * inverse
    density = np.exp(-0.5 * innovation * scaled) * np.sqrt(inverse)
    density += OUTLIER_DENSITY / constants.least_light
    means += to_means * scaled
    gains = to_means * inverse
    covariance[U_ROWS] -= gains[0] * to_means
    covariance[V_ROWS] -= gains[1] * to_means
    covariance[PACE_ROW] -= gains[2] * to_means[2]
    weight = predicted[0] * probability * density * _constrain(sources[1], predicted, constants)
    return _merge(weight, means, covariance)


def _predict(sources: Array, constants: BankConstants) -> Array:
    """Moments before the reading: probability, means, and the covariances of u, of v and of the pace.

    Light changes u by its pace, and v by the share q of that, which is known up to its sd.
    """
    rules, share = mode_transitions().predictions, constants.black_share
    weight, before, dark, pace, uu, uv, vv, up, vp, pp = sources
    scale = before * before
    pp = rules.pace_share_squared * pp + rules.sunlight_variance + rules.pace_variance * scale
    pp += rules.pace_change_variance * pace * pace
    up, vp, pace = rules.pace_share * up, rules.pace_share * vp, rules.pace_share * pace
    changed = pp + rules.standing_variance * scale
    share_known = 2.0 * (before - constants.start_light) + pace
    predicted = np.empty((11, *before.shape))
    predicted[0] = weight
    np.add(before, pace, out=predicted[1])
    np.add(dark, share * pace, out=predicted[2])
    predicted[3] = pace
    predicted[4] = uu + 2.0 * up + changed
    predicted[5] = predicted[7] = uv + share * (up + changed) + vp
    predicted[6] = up + pp
    predicted[8] = vv + share * (2.0 * vp + share * changed)
    predicted[8] += np.maximum(constants.black_share_sd**2 * pace * share_known, 0.0)
    predicted[9] = vp + share * pp
    predicted[10] = pp
    predicted[[3, 6, 9, 10]] *= rules.keeps_pace
    return predicted


def _with_floor_modes(modes: Array, constants: BankConstants) -> Array:
    """The modes, and behind them those that reach another floor or leave for it (`Predictions`). There the
    light of the floor ahead is in black's place, and in white's once it is reached.

    What looks like another floor may be the sharp edge of a shadow: black changes by half of that.
    """
    every = np.concatenate(
        [modes, modes[:, :, BORDER_MODES], modes[:, :, [0, OTHER_FLOOR_MODE, OTHER_FLOOR_MODE]]], axis=2
    )
    arriving, leaving = every[:, :, MODES:-3], every[:, :, -3:]
    weight, light, dark, _, uu, uv, vv, up, vp, _ = arriving
    short = np.minimum(dark[:, :STAGES] / (MIN_FLOOR_RATIO * light[:, :STAGES]) - 1.0, 0.0)
    weight[:, :STAGES] *= np.exp(-50.0 * short * short)
    change = 0.5 * constants.black_share * (dark - light)
    light[:], uu[:] = dark, vv
    np.maximum(constants.start_dark + change, constants.least_dark, out=dark)
    np.add(constants.start_dark_var, change * change, out=vv)
    dark[:, STAGES:], vv[:, STAGES:] = constants.former_dark, constants.former_dark_var
    uv[:] = up[:] = vp[:] = 0.0
    _, light, dark, _, _, uv, vv, _, vp, _ = leaving
    mean, sd = OTHER_FLOOR_RATIO
    light_ahead = light[:, :2]
    dark[:, :2], vv[:, :2] = mean * light_ahead, (sd * light_ahead) ** 2
    former = constants.former_light
    dark[:, 2:], vv[:, 2:] = former, constants.former_light_var + (FLOOR_RETURN_SD * former) ** 2
    uv[:] = vp[:] = 0.0
    return every


def _constrain(before: Array, moments: Array, constants: BankConstants) -> Array:
    """Move u and v within their bounds; returns the likelihood that they were within.

    u is at least the sensor's own light. Black reflects at most its share of any light: a mode with more gets
    the likelihood of an error of that size, and continues at the bound. before: u before the reading, one for
    each prediction.
    """
    transitions = mode_transitions()
    _, light, dark, _, uu, uv, _, _, vv, *_ = moments
    max_share = constants.black_share + 2.0 * constants.black_share_sd
    excess = np.maximum(dark - max_share * light - transitions.leaked_light, 0.0)
    to_light, to_dark = uv - max_share * uu, vv - max_share * uv
    correction = excess / (to_dark - max_share * to_light + 1e-4 * light * light)
    unlikely = -0.5 * excess * correction
    least = constants.least_light
    if np.any(light < least):
        short = np.minimum(light / least - 1.0, 0.0)
        was = np.minimum(before.take(transitions.prediction, axis=1) / least - 1.0, 0.0)
        unlikely -= 50.0 * np.maximum(short * short - was * was, 0.0)
    light -= to_light * correction
    np.maximum(light, 0.5 * least, out=light)
    dark -= to_dark * correction
    np.maximum(dark, constants.least_dark, out=dark)
    np.minimum(dark, 0.97 * light + transitions.max_excess_light, out=dark)
    return np.asarray(np.exp(unlikely))


def _merge(weight: Array, means: Array, covariance: Array) -> Array:
    """Merge all transitions that arrive at a mode to one Gaussian with the same moments."""
    transitions = mode_transitions()
    reached, starts = transitions.reached_modes, transitions.reached_starts
    weight /= weight.sum(axis=1, keepdims=True)
    weight += 1e-30  # an improbable mode stays in the bank
    total = np.add.reduceat(weight, starts, axis=1)
    mean = np.add.reduceat(weight * means, starts, axis=2) / total
    off = means - mean.take(transitions.reached_index, axis=2)
    covariance[U_ROWS] += off[0] * off
    covariance[V_ROWS] += off[1] * off
    covariance[PACE_ROW] += off[2] * off[2]
    covariance *= weight
    spread = np.add.reduceat(covariance, starts, axis=2) / total
    merged = np.zeros((10, len(weight), MODES))  # no other floor is reached while light moves
    merged[0, :, reached] = total.T
    merged[1:4, :, reached] = mean
    merged[4:, :, reached] = spread[COVARIANCE_ROWS]
    return merged
