"""Buildings: facades, roofs, and the kinds of building that are made of them."""
