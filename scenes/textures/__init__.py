"""Texture generators, a module a kind of picture. A new `Texture` subclass in a module here is found by itself."""

import sys

from scenes.discovery import concrete_subclasses
from scenes.spec import Texture

TEXTURES: dict[str, type[Texture]] = concrete_subclasses(sys.modules[__name__], Texture)  # type: ignore[type-abstract]
"""Every texture by class name."""
