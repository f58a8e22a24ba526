"""Generates the built-in towns: from a recipe to planned roads, and from these to SUMO's plain XML."""
