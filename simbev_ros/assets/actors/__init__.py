"""Builds models of vehicles, riders, pedestrians and props from shape descriptions (shapes/*.yaml)."""
