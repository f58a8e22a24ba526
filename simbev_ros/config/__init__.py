"""Configuration: pydantic models of the YAML file, distributions for drawn values, and the loader."""
