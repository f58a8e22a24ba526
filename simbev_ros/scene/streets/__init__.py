"""Graphs over the lanes of a map: where vehicles can drive and where pedestrians can walk."""
