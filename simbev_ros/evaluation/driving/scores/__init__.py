"""Scores of a drive by the definitions of others, one module for each; ``coefficients.yaml`` has their numbers."""
