"""Before a match: calibrations, checks and rehearsals that a program runs on its robot."""
