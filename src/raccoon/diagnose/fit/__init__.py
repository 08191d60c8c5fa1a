"""Fits by simulation error: one linear algebra of recording and simulator, its noise, and the way down."""
