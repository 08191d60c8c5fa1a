"""EMPS: a positioning axis (motor and ball screw) at 1 kHz, with commanded force and measured position, as a
MATLAB file: `vir` command to the drive in V, `gtau` N/V, `qm` m, `t` s."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from raccoon.core.errors import TraceError
from raccoon.trace.foreign.table import MAX_BYTES
from raccoon.trace.recording import Recording


def read_emps(path: str | Path) -> Recording:
    """Read an EMPS file: columns `motor.0.force` (N) and `motor.0.travel` (m).

    Raises TraceError if the file is not of this kind, FileNotFoundError if there is none.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    path = Path(path)
    if path.stat().st_size > MAX_BYTES:
        raise TraceError(f"{path}: the file has more than {MAX_BYTES} bytes")
    try:
        held = loadmat(path)
        time, command, position = (np.asarray(held[name], float).ravel() for name in ("t", "vir", "qm"))
        force = command * float(np.asarray(held["gtau"]).squeeze())
    except (LookupError, TypeError, ValueError, NotImplementedError, MatReadError) as error:
        raise TraceError(
            f"{path}: {error}: of MATLAB files only those with t, vir, gtau and qm are read"
        ) from None
    except (OSError, zlib.error) as error:
        if isinstance(error, OSError) and error.filename is not None:
            raise  # it cannot be opened
        raise TraceError(f"{path}: the file is damaged, or cut off: {error}") from None
    return Recording({"t": time, "motor.0.force": force, "motor.0.travel": position})
