"""Builds, caches and loads the static world region by region."""
