"""Exact labels from rays at the scene's own meshes, and what follows from a disparity map alone."""
