"""Causes that no catalogue lists: what the unexplained residual depends on."""
