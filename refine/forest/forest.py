"""A random forest as plain arrays, evaluated here and stored without pickle, so that reading one runs no code."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from refine.forest.features import FEATURES, confidence_features
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import write_bytes
from stereoforge_kit.kernels import njit, prange

FORMAT = "1"
LEAF = -1
"""In place of a feature's number."""


class ForestError(InputError):
    """A file holds no forest, or one for other features."""


@dataclass(frozen=True)
class Forest:
    """Binary trees, all in one list of nodes; a child's number is larger than its parent's."""

    roots: NDArray[np.int32]
    """(T,) the trees' first nodes."""
    feature: NDArray[np.int8]
    """(N,) what a node asks about, or `LEAF`."""
    threshold: NDArray[np.float32]
    """(N,) it goes left where the feature is at most this."""
    left: NDArray[np.int32]
    """(N,) number of the left child; 0 in leaves."""
    right: NDArray[np.int32]
    """(N,) number of the right child; 0 in leaves."""
    value: NDArray[np.float32]
    """(N,) probability of being right, in leaves."""

    def probability(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean over the trees of the probability in the leaf each sample (N, F) falls into: (N,)."""
        samples = np.ascontiguousarray(features, np.float32)
        return _walk(samples, self.roots, self.feature, self.threshold, self.left, self.right, self.value)

    def confidence(
        self, disparity: NDArray[np.float32], consistency: NDArray[np.float32], image: NDArray[np.uint8]
    ) -> NDArray[np.float32]:
        """(H, W) in [0, 1]; arguments as for `confidence_features`."""
        features = confidence_features(disparity, consistency, image)
        return self.probability(features.reshape(-1, features.shape[2])).reshape(disparity.shape)


def save_forest(path: Path, forest: Forest, about: dict[str, Any]) -> None:
    """Write a forest in one step, with what `about` says of its origin."""
    notes = {"format": FORMAT, "features": json.dumps(FEATURES), "about": json.dumps(about)}
    write_bytes(path, save({name: getattr(forest, name) for name in Forest.__dataclass_fields__}, notes))


def load_forest(path: Path) -> Forest:
    """Read a forest.

    Raises:
        ForestError: If the file is missing or damaged, holds no forest, or one that could not be walked to an end.
    """
    try:
        with safe_open(path, framework="np") as file:
            notes = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (OSError, SafetensorError) as error:
        raise ForestError(f"{path}: cannot be read as a forest ({error})") from error
    if notes.get("format") != FORMAT or notes.get("features") != json.dumps(FEATURES):
        raise ForestError(f"{path}: is not a forest on the {len(FEATURES)} features of this version")
    expected = {"roots": "i4", "feature": "i1", "threshold": "f4", "left": "i4", "right": "i4", "value": "f4"}
    if {name: array.dtype for name, array in arrays.items()} != expected:
        raise ForestError(f"{path}: does not hold the arrays of a forest")
    forest = Forest(**arrays)
    _check(path, forest)
    return forest


def _check(path: Path, forest: Forest) -> None:
    """Every walk must stay inside the arrays and come to an end."""
    nodes = forest.feature.shape
    same = all(getattr(forest, name).shape == nodes for name in ("threshold", "left", "right", "value"))
    if not same or forest.feature.ndim != 1 or forest.roots.ndim != 1 or not forest.roots.size:
        raise ForestError(f"{path}: the arrays of its forest do not fit together")
    numbers = np.arange(len(forest.feature))
    inner = forest.feature != LEAF
    children = np.stack([forest.left, forest.right])[:, inner]
    sound = (
        ((forest.roots >= 0) & (forest.roots < len(numbers))).all()
        and (forest.feature[inner] >= 0).all()
        and (forest.feature[inner] < len(FEATURES)).all()
        and (children > numbers[inner]).all()
        and (children < len(numbers)).all()
        and np.isfinite(forest.value).all()
    )
    if not sound:
        raise ForestError(f"{path}: the trees of its forest lead nowhere")


@njit("f4[::1](f4[:,::1], i4[::1], i1[::1], f4[::1], i4[::1], i4[::1], f4[::1])", parallel=True)
def _walk(samples, roots, feature, threshold, left, right, value):  # type: ignore[no-untyped-def]
    result = np.empty(len(samples), np.float32)
    for i in prange(len(samples)):
        total = 0.0
        for root in roots:
            node = root
            while feature[node] != LEAF:
                node = left[node] if samples[i, feature[node]] <= threshold[node] else right[node]
            total += value[node]
        result[i] = np.float32(total / len(roots))
    return result
