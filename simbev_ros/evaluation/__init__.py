"""Compares the predictions of perception stacks with the ground truth, and computes metrics and tables."""
