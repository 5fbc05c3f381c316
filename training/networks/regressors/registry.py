"""Which regressors there are. A new one is one module in this folder with a `Regressor` subclass."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import training.networks.regressors
from stereoforge_kit.discovery import concrete_subclasses
from training.errors import TrainingError
from training.networks.regressors.interface import Regressor, RegressorConfig


@cache
def known_regressors() -> Mapping[str, type[Regressor]]:
    """Every regressor there is, by name.

    Raises:
        TrainingError: two modules define one of the same name.
    """
    regressors: dict[str, type[Regressor]] = {}
    for kind in concrete_subclasses(training.networks.regressors, Regressor).values():  # type: ignore[type-abstract]
        if kind.name in regressors:
            other = regressors[kind.name].__module__
            raise TrainingError(f"{kind.__module__} and {other} both define a regressor {kind.name!r}")
        regressors[kind.name] = kind
    return regressors


def find_regressor(name: str) -> type[Regressor]:
    """The regressor of a name.

    Raises:
        TrainingError: there is none; lists those that there are.
    """
    known = known_regressors()
    if name not in known:
        raise TrainingError(f"there is no network {name!r}; there are {', '.join(sorted(known))}")
    return known[name]


def regressor_for(config: RegressorConfig) -> type[Regressor]:
    """The regressor whose options a config is.

    Raises:
        TypeError: no regressor has such options.

    Examples:
        >>> from training.networks.regressors.costvolume import CostVolumeConfig
        >>> regressor_for(CostVolumeConfig()).title
        'CostVolumeNet'
    """
    for regressor in known_regressors().values():
        if regressor.config_type is type(config):
            return regressor
    raise TypeError(f"no regressor takes a {type(config).__name__}")
