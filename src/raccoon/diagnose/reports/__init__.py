"""A diagnosis as text, page and picture."""
