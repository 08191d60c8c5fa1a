"""The world of a simulated robot: tables, its overlap with obstacles, and the resulting loads on its
wheels."""
