"""The drive's extended Kalman filter: states, model, unrolled algebra and its readable equivalent."""
