"""The link to the co-processor: the SPI bus, its lock and the reset line."""
