"""Open-loop simulation along recorded commands, of one robot or of many side by side."""
