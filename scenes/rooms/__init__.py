"""Rooms: their plan, what they are furnished with, the light in them, and the rig that looks at them."""
