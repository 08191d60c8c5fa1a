"""Which firmware made a recording: as its device, robot.toml or its readings say, and how that filters."""
