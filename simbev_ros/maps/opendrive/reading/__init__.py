"""Reads OpenDRIVE files into dataclasses, without interpreting them."""
