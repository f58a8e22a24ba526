"""Builds all geometry as triangle meshes: the static world, and the catalogue of vehicle and pedestrian models."""
