"""The diagnosis of wheel angles with a reference of the pose, without commands."""
