"""What cameras see of each object: visible pixels, silhouettes, truncation and 2D boxes."""
