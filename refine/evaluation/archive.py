"""Evaluations on disk, so that long studies keep what they have finished.

`evaluation.json` holds the records, `evaluation.npz` their arrays, which the JSON refers to by name. Reading runs no
code: the JSON is structured into typed records, and the arrays are read without pickle.
"""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any, get_origin

import cattrs
import numpy as np
from numpy.typing import NDArray

from refine.evaluation.results import EvaluatedSet
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import write_bytes, write_text

FORMAT = 1
RECORDS = "evaluation.json"
ARRAYS = "evaluation.npz"


def write_evaluation(folder: Path, evaluated: EvaluatedSet) -> None:
    """Write an evaluation into a folder, made if missing; a killed process leaves a whole one or none."""
    arrays: dict[str, NDArray[Any]] = {}
    places: dict[int, str] = {}

    def put_away(array: NDArray[Any]) -> str:
        # Frames appear twice, among the first and the worst: once on disk is enough.
        if id(array) not in places:
            places[id(array)] = f"a{len(arrays)}"
            arrays[places[id(array)]] = array
        return places[id(array)]

    converter = cattrs.Converter()
    converter.register_unstructure_hook_func(_is_array_type, put_away)
    converter.register_unstructure_hook(np.ndarray, put_away)
    converter.register_unstructure_hook_func(_is_set_type, sorted)
    document = {"format": FORMAT, "set": converter.unstructure(evaluated, EvaluatedSet)}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_bytes(folder / ARRAYS, buffer.getvalue())
    write_text(folder / RECORDS, json.dumps(document) + "\n")


def read_evaluation(folder: Path) -> EvaluatedSet:
    """Read what `write_evaluation` wrote. Raises ValueError, naming the file, for anything else."""
    path = folder / RECORDS
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise InputError(f"is not of format {FORMAT}")
        with np.load(folder / ARRAYS, allow_pickle=False) as arrays:
            converter = cattrs.Converter(forbid_extra_keys=True)
            converter.register_structure_hook_func(_is_array_type, lambda name, _: arrays[name])
            evaluated: EvaluatedSet = converter.structure(document["set"], EvaluatedSet)
    except (
        cattrs.BaseValidationError,
        OSError,
        ValueError,
        KeyError,
        TypeError,
        zipfile.BadZipFile,
    ) as error:
        reason = (
            "; ".join(cattrs.transform_error(error))
            if isinstance(error, cattrs.BaseValidationError)
            else getattr(error, "strerror", None) or error
        )
        raise InputError(f"{path}: is not a whole evaluation ({reason})") from error
    return evaluated


def _is_set_type(kind: Any) -> bool:
    return get_origin(kind) is frozenset


def _is_array_type(kind: Any) -> bool:
    return kind is np.ndarray or get_origin(kind) is np.ndarray
