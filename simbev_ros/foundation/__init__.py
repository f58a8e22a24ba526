"""Parts without a subject of their own that every room builds on: errors, units, geometry, files, caches."""
