"""What to render: the recipe, its limits on disparities, and the user's files it names."""
