"""What rooms are built and furnished with: walls, windows, furniture, lamps, and the things that stand about."""
