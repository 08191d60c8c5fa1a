"""Identification of the firmware that made a recording, and its filter of back-EMF."""
