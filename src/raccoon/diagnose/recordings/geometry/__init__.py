"""Wheel angles beside a reference of the pose, without commands."""
