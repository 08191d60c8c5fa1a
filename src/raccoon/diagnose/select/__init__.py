"""Which causes: one by one, in sets, and from which evidence on."""
