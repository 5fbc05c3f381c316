"""Shapes of streets, in metres: buildings, vehicles, furniture, people."""
