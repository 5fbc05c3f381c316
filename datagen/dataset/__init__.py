"""Data sets on disk: where files lie, what a manifest says of them, and how their frames are read."""
