"""The simulator driven by the commands of a recording, with the known properties of its controller."""
