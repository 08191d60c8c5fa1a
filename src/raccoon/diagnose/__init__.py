"""What the simulation gets wrong, and why. docs/architecture.md says in which order to read it."""
