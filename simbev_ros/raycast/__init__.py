"""Embree: the only package that imports Open3D."""
