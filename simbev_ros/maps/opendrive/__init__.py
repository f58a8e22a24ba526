"""Importer for OpenDRIVE files (.xodr, 1.4 to 1.8): an exact reader of their geometry, and a SUMO net made from it."""
