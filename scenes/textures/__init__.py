"""Texture generators, by kind of image. A new `Texture` subclass in a module here needs no registration."""

import sys

from scenes.spec import Texture
from stereoforge_kit.discovery import concrete_subclasses

TEXTURES: dict[str, type[Texture]] = concrete_subclasses(sys.modules[__name__], Texture)  # type: ignore[type-abstract]
"""Every texture by class name."""
