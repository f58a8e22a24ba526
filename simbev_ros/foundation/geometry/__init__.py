"""Geometry shared by all packages: rigid transforms, camera models, BEV and voxel grids, geodesy. Pure functions."""
