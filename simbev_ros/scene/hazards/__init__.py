"""Hazard areas: accidents and work zones, where they find room, and what stands in and around them."""
