"""The MRF as a differentiable torch function, for batches."""
