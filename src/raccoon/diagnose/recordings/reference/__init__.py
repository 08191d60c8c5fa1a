"""A reference of the pose beside a drive: motion capture, or what a simulator knows."""
