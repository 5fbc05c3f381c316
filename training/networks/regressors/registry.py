"""Which regressors there are. A new one is one module in this folder with a `Regressor` subclass."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache

import training.networks.regressors
from training.errors import TrainingError
from training.networks.regressors.interface import Regressor, RegressorConfig


@cache
def known_regressors() -> Mapping[str, type[Regressor]]:
    """Every regressor there is, by name.

    Raises:
        TrainingError: two modules define one of the same name.
    """
    regressors: dict[str, type[Regressor]] = {}
    package = training.networks.regressors
    for found in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(found.name)
        for _, member in inspect.getmembers(module, inspect.isclass):
            local = member.__module__ == found.name
            if local and issubclass(member, Regressor) and member is not Regressor:
                if member.name in regressors:
                    other = regressors[member.name].__module__
                    raise TrainingError(f"{found.name} and {other} both define a regressor {member.name!r}")
                regressors[member.name] = member
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
