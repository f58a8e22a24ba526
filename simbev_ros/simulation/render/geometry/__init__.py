"""Meshes on the GPU: actors, the static world, culling and levels of detail."""
