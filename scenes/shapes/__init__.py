"""Shape generators, by kind of geometry. A new `Shape` subclass in a module here needs no registration."""

import sys

from scenes.spec import Shape
from stereoforge_kit.discovery import concrete_subclasses

SHAPES: dict[str, type[Shape]] = concrete_subclasses(sys.modules[__name__], Shape)  # type: ignore[type-abstract]
"""Every shape by class name."""
