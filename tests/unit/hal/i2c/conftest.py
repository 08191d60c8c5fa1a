"""The bus of the board, on whatever answers in a module's `kernel`."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from i2c_fake import FakeI2c
from raccoon.hal.i2c import I2cBus


@pytest.fixture
def bus(kernel: FakeI2c, tmp_path: Path) -> Iterator[I2cBus]:
    (tmp_path / "i2c-1").touch()
    ready = I2cBus(str(tmp_path / "i2c-1"))
    yield ready
    ready.close()
