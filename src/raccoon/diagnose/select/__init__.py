"""Selection of causes: one at a time and in sets, each with a gate of log evidence."""
