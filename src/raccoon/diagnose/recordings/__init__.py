"""Recordings other than a drive of the whole robot: one motor or axis, geometry, single steps, tophats."""
