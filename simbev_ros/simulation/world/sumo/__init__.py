"""SUMO: the input that it needs, its state as arrays, and the part of its network that a scene uses."""
