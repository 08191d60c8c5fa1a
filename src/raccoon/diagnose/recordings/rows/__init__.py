"""Which rows of a recording are used."""
