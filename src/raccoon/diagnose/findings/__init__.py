"""From a finished search to results: validation of causes, uncertainty of numbers, gain, and their
wording."""
