"""Words that every layer shares: readings, errors, configuration, the port and the clock.

Standard library only, so that importing it costs next to nothing.
"""
