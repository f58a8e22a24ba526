"""Meshes as numpy arrays: the static surroundings, vehicles, people, and the catalogue of models."""
