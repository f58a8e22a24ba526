"""Events along a route: ``motion`` is what all motions share, ``motions`` has them, ``route_events`` the table."""
