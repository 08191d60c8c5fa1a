"""A separate process that stops the motors of a program that was killed or hangs, on any controller."""
