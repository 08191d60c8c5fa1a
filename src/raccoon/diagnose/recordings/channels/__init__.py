"""Channels that lie, stand for nothing or are not there, before anything is fitted."""
