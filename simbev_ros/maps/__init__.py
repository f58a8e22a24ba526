"""Road networks: the model, and what builds it."""
