"""Exporter to T4, the format of TIER IV's datasets for Autoware; a relative of nuScenes'."""
