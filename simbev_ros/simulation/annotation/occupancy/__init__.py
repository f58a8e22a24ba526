"""Semantic occupancy ground truth: exact voxelization of surfaces and solids around the ego."""
