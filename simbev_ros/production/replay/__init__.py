"""Replays of recorded scenes: which bags are replayed, and recording them by one graph or by several workers."""
