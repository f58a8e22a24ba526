"""Exact labels from the world state and the meshes."""
