"""Non-rigid motions. A new `Deformation` subclass in a module here is found by itself."""

import sys

from scenes.discovery import concrete_subclasses
from scenes.spec import Deformation

DEFORMATIONS: dict[str, type[Deformation]] = concrete_subclasses(
    sys.modules[__name__],
    Deformation,  # type: ignore[type-abstract]
)
"""Every deformation by class name."""
