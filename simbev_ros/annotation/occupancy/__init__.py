"""Semantic occupancy: exact voxelization of surfaces and solids."""
