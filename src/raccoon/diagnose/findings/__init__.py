"""What a search found: which causes stand, how sure their numbers are, how they are said, what they gain."""
