"""The KIPR Wombat: a Raspberry Pi and a co-processor on an SPI bus, with either of two firmwares."""
