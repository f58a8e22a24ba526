"""Motion of events along a route, one module per family of kinds; ``route_events`` has the table."""
