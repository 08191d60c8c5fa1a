"""A simulated robot as data: the catalogue of effects, which are on, and the plant's numbers for it."""
