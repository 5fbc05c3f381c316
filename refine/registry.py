"""Which methods there are.

A new one is one module in `refine/baselines/` with a `Method` subclass; it is found by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import refine.baselines
import refine.methods
from refine.method import Method
from stereoforge_kit.discovery import concrete_subclasses
from stereoforge_kit.errors import InputError

PAPER_FIRST = ("regressor", "regressor_f", "gradnet", "sgbm", "wmf", "color", "tgv", "fbs", "grad")
PAPER_LAST = ("ours_quadratic", "ours", "ours_conf_gt")


@cache
def known_methods() -> Mapping[str, type[Method]]:
    """Every method there is, by name: the `Method` subclasses of the modules in the two packages."""
    methods: dict[str, type[Method]] = {}
    for package in (refine.methods, refine.baselines):
        for kind in concrete_subclasses(package, Method).values():  # type: ignore[type-abstract]
            if kind.name in methods:
                other = methods[kind.name].__module__
                raise InputError(f"{kind.__module__} and {other} both define a method {kind.name!r}")
            methods[kind.name] = kind
    return methods


def table_order() -> tuple[str, ...]:
    """Every method's name in the order of the tables: the paper's, and before the last of them what it has not."""
    names = known_methods()
    last = tuple(name for name in PAPER_LAST if name in names)
    first = tuple(name for name in PAPER_FIRST if name in names)
    return (*first, *sorted(names.keys() - {*first, *last}), *last)


def default_methods(names: tuple[str, ...] = ()) -> tuple[Method, ...]:
    """Methods with their default parameters: those named, in that order, or all there are.

    Raises:
        ValueError: If a name is not known.
    """
    known = known_methods()
    for name in names:
        if name not in known:
            raise InputError(f"there is no method {name!r}; known are {', '.join(sorted(known))}")
    return tuple(known[name]() for name in names or table_order())
