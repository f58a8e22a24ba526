"""Evaluation of a perception stack while the scene runs: answers are joined with the ground truth, frame by frame."""
