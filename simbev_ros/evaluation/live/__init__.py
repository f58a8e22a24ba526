"""Evaluates a perception stack while the scene runs: joins answers with the ground truth, frame by frame."""
