"""A simulated robot as data: the catalogue of effects, those that are switched on, and the plant's
numbers."""
