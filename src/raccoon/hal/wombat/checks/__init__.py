"""The checks of each cycle: they turn bytes into valid frames and report what is wrong with them."""
