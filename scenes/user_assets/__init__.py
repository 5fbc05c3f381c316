"""User assets: meshes, textures and environments from the user's files."""
