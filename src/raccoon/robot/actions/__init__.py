"""Actions, their composition, the conditions that end them, and the checks of their arguments."""
