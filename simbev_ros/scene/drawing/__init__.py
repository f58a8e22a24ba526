"""Draws scenes: configuration and map in, a complete specification out."""
