"""Driving: to a goal, along a path, by lines and walls, or on until something ends it."""
