"""The one place that joins a port, estimators and controllers, and owns the loop."""
