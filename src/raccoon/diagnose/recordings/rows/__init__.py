"""Selection of the rows of a recording that are used."""
