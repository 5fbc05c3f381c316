"""The user's own meshes, textures and environments."""
