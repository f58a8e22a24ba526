"""MCAP files: writing, indexing, checking and salvaging them."""
