"""Metrics of detections and bird's-eye-view segmentations against the truth: pure functions of arrays."""
