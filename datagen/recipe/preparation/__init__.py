"""Reading the user's own files: meshes with their materials, pictures and panoramas become plain arrays."""
