"""Habits of controller, gears and log, which a recording does not state: estimated first, and tested again
later."""
