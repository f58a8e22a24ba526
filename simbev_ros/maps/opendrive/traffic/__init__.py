"""Turns the roads of an OpenDRIVE file into a net for SUMO."""
