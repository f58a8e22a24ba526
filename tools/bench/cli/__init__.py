"""``simbev bench``: times parts of the system on this machine and prints tables."""
