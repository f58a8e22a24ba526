"""``simbev scene``: draws scenes without simulating them and prints statistics of their parameters."""
