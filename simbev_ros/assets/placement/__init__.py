"""Placement of objects in a region: the ground they stand on, claimed footprints, and the tiles that hold meshes."""
