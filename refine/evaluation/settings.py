"""The file of validated parameters: written by `stereoforge tune`, read by `evaluate` and `refine`.

JSON: `methods` holds each method's parameters as its dataclass has them and what they brought on the validation
split; `trials` every setting that was tried, so that an interrupted search goes on; `about` what they were tried on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cattrs

from refine.evaluation.tuning import Trial, TunedMethod
from refine.method import Method
from refine.methods.ours import Ours
from refine.methods.ours_quadratic import OursQuadratic
from refine.registry import default_methods, known_methods
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import write_text

FORMAT = 1

_CONVERTER = cattrs.Converter(forbid_extra_keys=True)


@dataclass(frozen=True)
class Settings:
    """Methods with validated parameters."""

    methods: Mapping[str, Method] = field(default_factory=dict)
    """By name."""
    trials: Mapping[str, tuple[Trial, ...]] = field(default_factory=dict)
    """By method."""
    about: Mapping[str, Any] = field(default_factory=dict)
    """What the parameters were validated on, and how."""

    def method(self, name: str) -> Method:
        """The named method, with validated parameters if there are any; raises InputError if there is none."""
        return self.methods[name] if name in self.methods else default_methods((name,))[0]

    @property
    def ours(self) -> Ours:
        """The MRF."""
        method = self.method(Ours.name)
        assert isinstance(method, Ours)
        return method

    @property
    def ours_quadratic(self) -> OursQuadratic:
        """The MRF with the paper's energy."""
        method = self.method(OursQuadratic.name)
        assert isinstance(method, OursQuadratic)
        return method

    def rows(self, names: tuple[str, ...] = ()) -> tuple[Method, ...]:
        """`default_methods` with validated parameters."""
        return tuple(self.method(method.name) for method in default_methods(names))


def write_settings(path: Path, tuned: Mapping[str, TunedMethod], about: Mapping[str, Any]) -> None:
    """Write the file of parameters in one step."""
    document = {
        "format": FORMAT,
        "about": dict(about),
        "methods": {name: asdict(result.method) for name, result in tuned.items()},
        "trials": {name: [_plain(trial) for trial in result.trials] for name, result in tuned.items()},
    }
    write_text(path, json.dumps(document, indent=1, allow_nan=False) + "\n")


def read_settings(path: Path) -> Settings:
    """Read a file of parameters.

    Raises:
        InputError: If it is missing, damaged, of another version, or sets a parameter that does not exist. The message
            names the file.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a file of parameters ({error})") from error
    if not isinstance(document, dict) or document.keys() != {"format", "about", "methods", "trials"}:
        raise InputError(f"{path}: is not a file of parameters that stereoforge tune wrote")
    if document["format"] != FORMAT:
        raise InputError(f"{path}: has format {document['format']}, this version reads {FORMAT}")
    known = known_methods()
    methods: dict[str, Method] = {}
    trials: dict[str, tuple[Trial, ...]] = {}
    try:
        for name, values in document["methods"].items():
            if name not in known:
                raise InputError(f"there is no method {name!r}")
            methods[name] = _CONVERTER.structure(values, known[name])
        for name, tried in document["trials"].items():
            trials[name] = tuple(_trial(values) for values in tried)
    except (cattrs.BaseValidationError, cattrs.StructureHandlerNotFoundError) as error:
        reason = "; ".join(cattrs.transform_error(error))
        raise InputError(f"{path}: does not set the parameters of {name} ({reason})") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: is not a whole file of parameters ({error})") from error
    return Settings(methods, trials, document["about"])


def _plain(trial: Trial) -> dict[str, Any]:
    finite = math.isfinite(trial.objective)
    return {"setting": dict(trial.setting), "objective": trial.objective if finite else None}


def _trial(values: Mapping[str, Any]) -> Trial:
    objective = values["objective"]
    return Trial(dict(values["setting"]), math.inf if objective is None else float(objective))
