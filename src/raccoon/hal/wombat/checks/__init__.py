"""What the port does with each cycle: bytes become good frames, and what is wrong with them is said."""
