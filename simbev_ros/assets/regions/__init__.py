"""Builds, stores and loads the static world region by region."""
