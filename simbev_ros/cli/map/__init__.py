"""``simbev map``: builds a map, prints its statistics and draws pictures of it."""
