"""Putting things into a scene: by their anchors, on ground, in view, out of the cameras' way.

`assembly` collects materials and objects and places shapes by their anchors; `view` knows where the cameras
are and what they see; `boxes` bounds things; `clearance` leaves out what comes too near; `ground` stands
things on ground before a camera. All families use it; it knows no landscape, street or family.
"""
