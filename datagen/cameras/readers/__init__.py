"""Formats of calibrations, one module each with a `READER`."""
