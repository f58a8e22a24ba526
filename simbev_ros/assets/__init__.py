"""Builds all geometry as triangle meshes: the static world, and the catalog of vehicle and pedestrian models."""
