"""Hazard areas (accidents and work zones): where they fit on a map, and what stands in and around them."""
