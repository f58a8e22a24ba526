"""The mesh type and the geometry that builds meshes: primitives, clipping, draping over the ground."""
