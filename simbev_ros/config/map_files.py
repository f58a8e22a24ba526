"""File types of maps that a configuration can name instead of a town."""

MAP_SUFFIXES = (".xodr", ".osm", ".osm.xml", ".net.xml")
"""Suffixes of OpenDRIVE, OpenStreetMap (two) and SUMO net files."""
