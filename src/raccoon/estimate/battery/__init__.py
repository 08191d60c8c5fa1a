"""Battery voltage, curves of a pack and its state of charge."""
