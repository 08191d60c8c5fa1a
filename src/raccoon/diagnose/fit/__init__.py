"""Fits by simulation error: the problem, its linear model, its noise, and the descent."""
