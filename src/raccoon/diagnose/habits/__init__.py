"""What a recording does not say of controller, gears and log: found out first, and tried again later."""
