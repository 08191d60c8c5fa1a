"""The diagnosis of one motor or one axis: force, torque or voltage in, speed or position out."""
