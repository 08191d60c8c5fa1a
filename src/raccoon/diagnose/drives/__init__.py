"""A recorded drive: its rows and channels, and whether they are a drive at all."""
