"""The roads around the ego as vectors."""
