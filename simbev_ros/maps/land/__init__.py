"""The terrain around the roads: relief, water, and heights at any position."""
