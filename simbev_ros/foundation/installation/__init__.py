"""The system's libraries that the Python packages need, and those of them that a machine lacks."""
