"""What labels need of the rigid parts of actor models: blocks of triangles, and outermost points."""
