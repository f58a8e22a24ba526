"""The simulation: scene specification in, one world state per tick out."""
