"""Road networks: the data model, the importers of each map format, and the generator of the built-in towns."""
