"""Shape generators, by kind of geometry. A new `Shape` subclass in a module here needs no registration."""

import sys

from scenes.discovery import concrete_subclasses
from scenes.spec import Shape

SHAPES: dict[str, type[Shape]] = concrete_subclasses(sys.modules[__name__], Shape)  # type: ignore[type-abstract]
"""Every shape by class name."""
