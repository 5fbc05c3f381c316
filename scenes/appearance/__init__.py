"""How things look: materials, lights, palettes, painted patterns."""
