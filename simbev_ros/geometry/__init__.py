"""Pure maths: transforms, camera model, grids, geodesy."""
