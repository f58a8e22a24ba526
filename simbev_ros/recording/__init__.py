"""Bags: writing, reading, metadata, integrity."""
