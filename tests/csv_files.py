"""Recordings as CSV files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_csv_file(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> Path:
    """The file, blank where a sensor gave nothing new."""
    rows = np.column_stack(list(columns.values()))
    text = [",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *text]) + "\n")
    return path
