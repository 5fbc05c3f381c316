"""What families of landscapes share: terrain, vegetation, characters, people."""
