"""Mesh type and the tools that build meshes: primitive solids, polygon clipping, draping areas over the ground."""
