"""Pure equations of the robot: SI floats or arrays in and out, no state."""
