"""Data sets on disk: where the files are, what a scene's manifest says of them, and how frames are read."""
