"""Texture generators, by kind of image. A new `Texture` subclass in a module here needs no registration."""

import sys

from scenes.discovery import concrete_subclasses
from scenes.spec import Texture

TEXTURES: dict[str, type[Texture]] = concrete_subclasses(sys.modules[__name__], Texture)  # type: ignore[type-abstract]
"""Every texture by class name."""
