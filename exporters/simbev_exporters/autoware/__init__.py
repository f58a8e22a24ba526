"""Exporter of a rig and its vehicle to Autoware's description packages."""
