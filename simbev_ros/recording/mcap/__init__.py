"""MCAP files, independent of scenes: writing, indexing, checking and salvaging them."""
