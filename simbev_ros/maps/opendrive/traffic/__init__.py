"""Converts the roads of an OpenDRIVE file to a SUMO net."""
