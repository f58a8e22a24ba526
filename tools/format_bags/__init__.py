"""Configurations and maps of the bags that a test keeps readable."""
