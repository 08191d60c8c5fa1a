"""Which rows of a recording are looked at."""
