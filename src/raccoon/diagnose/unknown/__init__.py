"""What no catalogue lists: what the unexplained depends on."""
