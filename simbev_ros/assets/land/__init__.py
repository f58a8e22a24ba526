"""Lays out the land between the streets of one region: blocks by land use, ground covers, buildings and plants."""
