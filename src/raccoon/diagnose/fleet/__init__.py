"""Many recordings side by side."""
