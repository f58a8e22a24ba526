"""Pictures, videos and HTML reports of recorded scenes, maps, datasets and evaluations."""
