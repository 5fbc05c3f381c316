"""A training run: the loop, checkpoints, weights on disk, the model card."""
