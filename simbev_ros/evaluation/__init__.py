"""Evaluation of perception stacks: predictions are compared with the ground truth, and metrics and tables result."""
