"""Events along a route: their kinds, and the places on a route that allow them."""
