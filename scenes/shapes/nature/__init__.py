"""Shapes of landscapes: land, plants, trees, masonry, creatures."""
