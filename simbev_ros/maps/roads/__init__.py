"""Ground geometry of the roads: lane strips, levels, heights, surfaces and paint."""
