"""The one configuration file: models, distributions, loader."""
