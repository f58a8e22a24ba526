"""Metrics as pure functions of arrays: matching, average precision, errors, segmentation, nuScenes' variant."""
