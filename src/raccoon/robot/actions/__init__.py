"""What a robot does over time: actions, how they are put together, what ends them, what they refuse."""
