"""Vector map ground truth: the roads around the ego as polylines with attributes."""
