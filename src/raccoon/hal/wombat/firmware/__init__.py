"""The two firmwares of the co-processor: frames received, commands sent, and what both have in common."""
