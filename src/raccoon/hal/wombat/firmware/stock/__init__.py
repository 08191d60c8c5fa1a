"""KIPR's own firmware."""
