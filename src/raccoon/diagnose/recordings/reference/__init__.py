"""A reference of the pose recorded with a drive: motion capture, or a simulator's true pose."""
