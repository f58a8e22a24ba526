"""Plans of our own towns: from a recipe to roads, from roads to SUMO's plain XML."""
