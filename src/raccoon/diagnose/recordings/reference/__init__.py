"""A reference of the pose beside a drive: motion capture, or a simulator's true pose."""
