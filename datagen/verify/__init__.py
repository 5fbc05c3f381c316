"""Verifying data sets: every file against its manifest, every disparity against its scene; and repair."""
