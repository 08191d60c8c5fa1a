"""What a robot drives on: tables, where it overlaps what stands there, and what that does to its wheels."""
