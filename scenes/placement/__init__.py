"""Putting things on the ground, in view, and out of the camera's way."""
