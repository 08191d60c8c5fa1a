"""An emulated co-processor of a Wombat: the same bytes on the link, the same quirks behind them.

`Emulator` is a link like the real bus. Behind it run the stock firmware or RaccoonOS on a plant (`Plant`)
that the caller provides; `Emulator.faults` breaks it while it runs.
"""

from raccoon.hal.wombat.emulator.emulator import Emulator, Firmware
from raccoon.hal.wombat.emulator.faults import Faults
from raccoon.hal.wombat.emulator.plant import COAST, Drive, Plant, PlantState

__all__ = ["COAST", "Drive", "Emulator", "Faults", "Firmware", "Plant", "PlantState"]
