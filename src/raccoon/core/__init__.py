"""Types that every layer shares: readings, errors, configuration, the port and the clock.

It imports the standard library only, so importing it is cheap.
"""
