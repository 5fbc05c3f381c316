"""Packages of the same name from elsewhere.

`scenes`, `datagen`, `training` and `refine` are common names for folders. One that Python finds before ours, such as a
`training/` beside a user's script, would be imported in its place.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

from stereoforge_kit.errors import UserError


class ShadowedPackageError(UserError, ImportError):
    """Another package stands where one of ours is looked for."""


def check_siblings(package_file: str, *names: str) -> None:
    """Check that packages would be imported from where another one of ours lies; imports none of them.

    Args:
        package_file: `__file__` of a package of ours.
        names: Packages that lie beside it.

    Raises:
        ShadowedPackageError: Python finds something else under one of the names.
    """
    home = Path(package_file).resolve().parent.parent
    for name in names:
        for place in _places(name):
            if place.resolve().parent != home:
                raise ShadowedPackageError(
                    f"{place} is in the way: Python finds it instead of StereoForge's own package {name}; rename it, "
                    "or run from another folder"
                )


def _places(name: str) -> list[Path]:
    """The folders of the package that a name stands for, or the file of a module; none if there is no such."""
    known = sys.modules.get(name)
    if known is not None:
        folders, file = getattr(known, "__path__", None), getattr(known, "__file__", None)
    else:
        spec = find_spec(name)
        folders, file = (None, None) if spec is None else (spec.submodule_search_locations, spec.origin)
    if folders:
        return [Path(folder) for folder in folders]
    return [] if file is None else [Path(file)]
