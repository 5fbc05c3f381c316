"""How things look: materials, lights, palettes, and the tools that textures are painted with."""
