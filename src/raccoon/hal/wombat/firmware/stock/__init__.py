"""The stock firmware of KIPR."""
