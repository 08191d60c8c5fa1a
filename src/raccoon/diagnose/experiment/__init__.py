"""Experiment design: choosing a drive that would decide what a recording leaves open, and driving it."""
