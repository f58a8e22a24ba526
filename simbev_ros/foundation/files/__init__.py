"""Files of unknown origin, read within limits, and files that are written whole."""
