"""Non-rigid motions. A new `Deformation` subclass in a module here needs no registration."""

import sys

from scenes.spec import Deformation
from stereoforge_kit.discovery import concrete_subclasses

DEFORMATIONS: dict[str, type[Deformation]] = concrete_subclasses(
    sys.modules[__name__],
    Deformation,  # type: ignore[type-abstract]
)
"""Every deformation by class name."""
