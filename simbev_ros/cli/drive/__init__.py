"""The group of commands ``simbev drive``."""
