"""SUMO nets: built, repaired, read."""
