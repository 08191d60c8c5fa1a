"""Which drive would decide what a recording leaves open, and driving it."""
