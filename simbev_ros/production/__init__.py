"""Playing scenes and making datasets from Python, without a console."""
