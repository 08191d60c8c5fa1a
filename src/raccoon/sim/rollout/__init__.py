"""Open-loop runs along recorded commands, of one robot or of many side by side."""
