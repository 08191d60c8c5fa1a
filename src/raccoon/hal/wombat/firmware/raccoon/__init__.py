"""RaccoonOS, versions 17 and 21."""
