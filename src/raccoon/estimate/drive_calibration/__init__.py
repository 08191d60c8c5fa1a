"""From a recorded manoeuvre to the drive's scales, offsets, radii and track width."""
