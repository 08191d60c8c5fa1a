"""What kind a recording is, what of it can be looked at, and how each kind is diagnosed."""
