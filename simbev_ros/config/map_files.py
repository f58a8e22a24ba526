"""Map files that a scenario may name instead of a town."""

MAP_SUFFIXES = (".xodr", ".osm", ".osm.xml", ".net.xml")
"""Suffixes of OpenDRIVE, OpenStreetMap and SUMO net files."""
