"""What may differ from the nominal model: coordinates, causes of them, and what robot.toml leaves open."""
