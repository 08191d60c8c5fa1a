from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from raccoon.core.errors import TraceError
from raccoon.trace.loading import load_run


def test_force_and_travel_are_read_in_si(tmp_path: Path) -> None:
    time = 0.001 * np.arange(50)
    savemat(
        tmp_path / "axis.mat",
        {"t": time[:, None], "vir": np.ones((50, 1)), "qm": time[:, None], "gtau": 35.0},
    )
    recording = load_run(tmp_path / "axis.mat").recording
    np.testing.assert_allclose(recording["motor.0.force"], 35.0)
    np.testing.assert_allclose(recording["motor.0.travel"], time)


def test_another_or_a_broken_file_is_named(tmp_path: Path) -> None:
    savemat(tmp_path / "other.mat", {"x": np.zeros(3)})
    (tmp_path / "broken.mat").write_bytes(b"MATLAB 5.0 nonsense" * 20)
    for name in ("other", "broken"):
        with pytest.raises(TraceError, match=f"{name}.mat.*only those with t, vir, gtau and qm"):
            load_run(tmp_path / f"{name}.mat")


@pytest.mark.parametrize("kept", [100, 129, 400, -9])
def test_a_file_that_was_cut_off_or_damaged_is_named(tmp_path: Path, kept: int) -> None:
    path, time = tmp_path / "axis.mat", 0.001 * np.arange(500)
    savemat(path, {"t": time, "vir": time, "qm": np.sin(time), "gtau": 35.0}, do_compression=True)
    whole = path.read_bytes()
    path.write_bytes(whole[:kept])
    with pytest.raises(TraceError, match=r"axis\.mat: "):
        load_run(path)
    path.write_bytes(whole[:400] + bytes(10) + whole[410:])
    with pytest.raises(TraceError, match=r"axis\.mat: the file is damaged"):
        load_run(path)
