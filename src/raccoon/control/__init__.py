"""Decisions: numbers in, numbers out."""
