"""Discovery of plug-ins: adding a module to a package is all it takes to add a kind of thing."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


def modules_in(package: ModuleType) -> list[ModuleType]:
    """The modules of a package and of its sub-packages, in alphabetical order of their own names.

    Sampling draws by position, so the order must not depend on the file system. A module's folder does not
    count either, so that moving it to another sub-package leaves every scene unchanged.
    """
    found = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    names = [module.name for module in found if not module.ispkg]
    return [importlib.import_module(name) for name in sorted(names, key=lambda name: (_own_name(name), name))]


def _own_name(module: str) -> str:
    return module.rpartition(".")[2]


def concrete_subclasses(package: ModuleType, base: type[T]) -> dict[str, type[T]]:
    """Every instantiable subclass of `base` defined in the package's modules, by class name.

    Raises TypeError for two of one name, because files tell kinds apart by name alone.
    """
    found: dict[str, type[T]] = {}
    for module in modules_in(package):
        for name, member in inspect.getmembers(module, inspect.isclass):
            local = member.__module__ == module.__name__
            if local and issubclass(member, base) and not inspect.isabstract(member):
                if name in found:
                    raise TypeError(f"{found[name].__module__} and {module.__name__} both define {name}")
                found[name] = member
    return found
