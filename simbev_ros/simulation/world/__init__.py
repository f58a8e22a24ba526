"""World simulation: a scene specification and its map in, one world state per tick out."""
