"""What a diagnosis is doing, for whoever waits for it."""

from raccoon.core.doing import tell as tell
