"""What is said again of a drive's diagnosis: one fault under several names, numbers that no robot has."""
