"""Predictions for recordings of real sensors: boxes in tables and in the formats of others, pictures, and scores."""
