"""Exact ground truth from rays cast at the scene's meshes, and targets derived from disparity maps alone."""
