"""Scores of methods on frames: pooling, intervals, tuning, and the evaluation kept on disk."""
