"""Results from a finished search: validation of causes, uncertainty of numbers, gain, and their wording."""
