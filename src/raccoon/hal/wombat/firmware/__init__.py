"""The two firmwares of the co-processor: what each sends, what each is told, and what both have in common."""
