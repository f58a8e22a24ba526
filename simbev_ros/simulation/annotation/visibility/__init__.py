"""Visibility ground truth: what cameras see of each object, as visible pixels, silhouettes, truncation and 2D boxes."""
