"""The plant: its quantities and equations, for one robot and in lanes of many robots, and their
compilation."""
