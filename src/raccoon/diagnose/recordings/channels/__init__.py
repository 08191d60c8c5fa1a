"""Channels of a drive that are faulty, missing, or stand for something else than their names say."""
