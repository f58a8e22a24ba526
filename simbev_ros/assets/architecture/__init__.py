"""Builds meshes of buildings: walls, roofs and details, and the kinds of building that combine them."""
