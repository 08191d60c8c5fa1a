"""The diagnosis of single motors, and of one motor's step response."""
