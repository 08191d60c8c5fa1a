"""Many simulated matches of one program, on any executor: how often it fails, and what that depends on."""
