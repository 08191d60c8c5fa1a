"""Odometry of the drive: from wheels, gyro and things seen to a pose with its uncertainty."""
