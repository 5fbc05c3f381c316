"""Fit the forest with scikit-learn."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier

from refine.forest.features import confidence_features
from refine.forest.forest import LEAF, Forest
from stereoforge_kit.errors import InputError

Map = NDArray[np.float32]


@dataclass(frozen=True)
class ForestConfig:
    """Size of the forest. Park and Yoon's code is not published; replications use 50 trees."""

    trees: int = 50
    samples: int = 400_000
    """Pixels looked at, drawn evenly from all frames."""
    leaf_samples: int = 100
    """Least number of pixels in a leaf (ours)."""
    leaves: int = 2000
    """At most so many in a tree; keeps the file small (ours)."""
    correct_within_px: float = 1.0
    """A disparity this close to the truth is right, as ConfNet's label has it."""


@dataclass(frozen=True)
class ForestFrame:
    """One training frame of the forest: (H, W) maps and the (H, W, 3) image."""

    image: NDArray[np.uint8]
    truth: Map
    disparity: Map
    consistency: Map


def grow_forest(frames: Iterable[ForestFrame], count: int, config: ForestConfig, seed: int) -> Forest:
    """A forest that tells right pixels from wrong ones.

    Args:
        frames: Read once, one at a time.
        count: How many they are, so that each gives its share of the samples.

    Raises:
        InputError: If no pixel has ground truth, or all of them are right, or all wrong.
    """
    rng = np.random.default_rng(seed)
    features, labels = [], []
    for frame in frames:
        known = np.flatnonzero(np.isfinite(frame.truth))
        drawn = rng.permutation(known)[: -(-config.samples // count)]
        seen = confidence_features(frame.disparity, frame.consistency, frame.image)
        right = np.abs(frame.disparity - frame.truth) <= config.correct_within_px
        features.append(seen.reshape(-1, seen.shape[2])[drawn])
        labels.append(right.ravel()[drawn])
    answers = np.concatenate(labels) if labels else np.empty(0, bool)
    if len(np.unique(answers)) < 2:
        raise InputError("a confidence can be learned only from frames with right and wrong pixels")
    grown = RandomForestClassifier(
        n_estimators=config.trees,
        min_samples_leaf=config.leaf_samples,
        max_leaf_nodes=config.leaves,
        max_features="sqrt",
        random_state=seed,
    ).fit(np.concatenate(features), answers)
    return as_forest(grown)


def as_forest(classifier: Any) -> Forest:
    """A fitted `RandomForestClassifier` of the classes False and True as plain arrays."""
    roots, feature, threshold, left, right, value = [], [], [], [], [], []
    start = 0
    for grown in classifier.estimators_:
        tree = grown.tree_
        # scikit-learn numbers a best-first tree's nodes in the order it splits them: children after their parents.
        leaf = tree.children_left < 0
        roots.append(start)
        feature.append(np.where(leaf, LEAF, tree.feature))
        threshold.append(np.where(leaf, 0, tree.threshold))
        left.append(np.where(leaf, 0, tree.children_left + start))
        right.append(np.where(leaf, 0, tree.children_right + start))
        value.append(tree.value[:, 0, 1] / tree.value[:, 0].sum(axis=1))
        start += tree.node_count
    return Forest(
        np.array(roots, np.int32),
        np.concatenate(feature).astype(np.int8),
        _at_most(np.concatenate(threshold)),
        np.concatenate(left).astype(np.int32),
        np.concatenate(right).astype(np.int32),
        np.concatenate(value).astype(np.float32),
    )


def _at_most(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """The largest float32 not above each value: float32 samples compare with it as with the value itself."""
    rounded = values.astype(np.float32)
    below = np.nextafter(rounded, np.float32(-np.inf))
    return np.where(rounded > values, below, rounded).astype(np.float32)
