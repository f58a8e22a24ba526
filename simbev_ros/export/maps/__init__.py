"""Writes a map in the forms that other tools read: OpenDRIVE, SUMO net, Lanelet2, OpenStreetMap."""
