"""A Wombat's co-processor in software: the same bytes on the link, the same stubbornness behind them.

`Emulator` is a link like the real bus. Behind it run the stock firmware or RaccoonOS on a plant that whoever
builds the emulator hands in (`Plant`); `Emulator.faults` breaks it while it runs.
"""

from raccoon.hal.wombat.emulator.emulator import Emulator, Firmware
from raccoon.hal.wombat.emulator.faults import Faults
from raccoon.hal.wombat.emulator.plant import COAST, Drive, Plant, PlantState

__all__ = ["COAST", "Drive", "Emulator", "Faults", "Firmware", "Plant", "PlantState"]
