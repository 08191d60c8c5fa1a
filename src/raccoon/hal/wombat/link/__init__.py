"""The bytes to and from the co-processor: the bus, who may use it, and the wire that resets."""
