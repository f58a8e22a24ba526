"""Vehicles, riders and people: their shapes as data (shapes/*.yaml) and the code that turns them into meshes."""
