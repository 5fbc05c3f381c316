"""The only folder that talks to Blender: a Scene in, rendered arrays and evaluated triangles out."""
