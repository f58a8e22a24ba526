"""Generates the reference pages of docs/ from the code, and checks links. ``python -m tools.docs`` writes the pages."""
