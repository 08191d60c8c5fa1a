"""The errors as values: what a pool of processes does with them."""

import pickle

import pytest

from raccoon import HardwareError, MotionTimeout, RaccoonError, ReplayDiverged


@pytest.mark.parametrize(
    "error",
    [ReplayDiverged(7, "duty of motor 0", 0.5, 0.25), MotionTimeout("not done"), HardwareError("lost")],
)
def test_an_error_goes_to_another_process(error: RaccoonError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
