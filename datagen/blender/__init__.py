"""The only folder that imports bpy: it builds a Scene in Blender and renders it to arrays."""

import sys
from pathlib import Path


def _forget_inherited_search_path() -> None:
    """Let `import bpy` find the library in a process spawned by one in which Blender already runs.

    Blender puts its own scripts on the search path, a package called bpy among them, and the spawned process
    inherits the path without the Blender that package belongs to.
    """
    if "bpy" not in sys.modules:
        sys.path[:] = [entry for entry in sys.path if not (Path(entry) / "bpy" / "__init__.py").is_file()]


_forget_inherited_search_path()
