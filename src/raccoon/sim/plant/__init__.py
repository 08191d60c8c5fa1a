"""The plant: its quantities and equations, for one robot and in lanes of many, and how they are compiled."""
