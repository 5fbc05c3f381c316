"""Calibrations of stereo rigs, read from the files of others; one module for each format, found by itself."""
