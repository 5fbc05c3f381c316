"""What the driving family is put together from: the street's course, its cross-section, and what lines it."""
