"""Scene drawing: configuration and map in, complete scene specifications out."""
