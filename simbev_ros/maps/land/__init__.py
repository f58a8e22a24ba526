"""The land beside the roads: relief, water, zones, heights."""
