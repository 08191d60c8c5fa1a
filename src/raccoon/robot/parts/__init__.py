"""What a robot is made of: drive base, tophats, servos and mechanisms, and the actions that move those."""
