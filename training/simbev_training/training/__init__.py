"""Training: augmented batches from a cache, targets, losses, and the loop with checkpoints and a log."""
