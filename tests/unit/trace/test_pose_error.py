import math

import numpy as np
import pytest

from raccoon.core.errors import TraceError
from raccoon.trace.pose_error import PoseError, field_truth, pool_errors, pose_error
from raccoon.trace.recording import Recording


def drive(x: list[float], y: list[float], heading: list[float]) -> Recording:
    columns = {"t": np.arange(len(x), dtype=float)}
    truth = {"x": x, "y": y, "heading": heading}
    return Recording(columns | {f"truth.{name}": np.array(values) for name, values in truth.items()})


def test_truth_is_seen_from_its_first_pose() -> None:
    x, y, heading = field_truth(drive([2.0, 2.0, 1.0], [1.0, 3.0, 3.0], [math.pi / 2, math.pi / 2, math.pi]))
    np.testing.assert_allclose(x, [0, 2, 2], atol=1e-12)
    np.testing.assert_allclose(y, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(heading, [0, 0, math.pi / 2])


def test_a_heading_that_a_reference_wraps_is_unwrapped() -> None:
    turned = np.array([0.0, 1.5, math.nan, 3.0, 4.5, 6.0, 7.5])
    wrapped = ((turned + math.pi) % math.tau - math.pi).tolist()
    recording = drive([0.0] * 7, [0.0] * 7, wrapped)
    np.testing.assert_allclose(field_truth(recording)[2], turned, atol=1e-12)
    error = pose_error(recording, np.zeros(7), np.zeros(7), np.nan_to_num(turned) + 0.1)
    assert error.heading_rms == pytest.approx(0.1)
    assert error.heading_final == pytest.approx(0.1)
    assert recording["truth.heading"][-1] == wrapped[-1], "the recording stays as it is"


def test_error_of_a_drive_by_hand() -> None:
    recording = drive([0.0, 1.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.1])
    x, y, heading = np.array([0.0, 1.0, 2.3]), np.array([0.0, 0.0, 0.4]), np.array([0.0, 0.0, 0.2])
    error = pose_error(recording, x, y, heading)
    assert error.distance == 2.0
    assert error.final == pytest.approx(0.5)
    assert error.rms == pytest.approx(0.5 / math.sqrt(3))
    assert error.heading_final == pytest.approx(0.1)
    assert error.heading_rms == pytest.approx(0.1 / math.sqrt(3))


def test_rows_without_truth_do_not_count() -> None:
    recording = drive([math.nan, 0.0, math.nan, 1.0], [0.0] * 4, [0.0] * 4)
    error = pose_error(recording, np.array([9.0, 0.0, 9.0, 1.0]), np.zeros(4), np.zeros(4))
    assert (error.rms, error.samples) == (0.0, 2)


def test_no_truth_is_refused() -> None:
    with pytest.raises(TraceError, match="no row in common"):
        field_truth(drive([math.nan], [0.0], [0.0]))
    with pytest.raises(TraceError, match=r"no column truth\.x"):
        field_truth(Recording({"t": np.zeros(1)}))


def test_pooling_weighs_samples_in_the_rms_and_runs_in_the_finals() -> None:
    short, long = PoseError(1, 0.0, 0.0, 0.0, 0.0, 1), PoseError(1, 2.0, 2.0, 2.0, -2.0, 3)
    both = pool_errors([short, long])
    assert both.runs == 2
    assert both.rms == both.heading_rms == pytest.approx(math.sqrt(3))
    assert both.final == both.heading_final == pytest.approx(math.sqrt(2))
    with pytest.raises(ValueError, match="no run"):
        pool_errors([])
