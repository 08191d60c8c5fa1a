"""The comparison of many recordings of one or several robots (a fleet)."""
