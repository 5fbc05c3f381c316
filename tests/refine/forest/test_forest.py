"""The random forest: features worked out pixel by pixel, probabilities equal to scikit-learn's, files that are safe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file
from sklearn.ensemble import RandomForestClassifier

from refine.forest import FEATURES, Forest, ForestError, confidence_features, load_forest, save_forest
from refine.forest.fitting import ForestConfig, ForestFrame, as_forest, grow_forest
from refine.metrics import sparsification_curve
from tests.refine.worlds import random_problem, toy_frame


@pytest.fixture(scope="module")
def samples():
    rng = np.random.default_rng(0)
    values = rng.normal(0, 1, (3000, len(FEATURES))).astype(np.float32)
    values[:, 3] = np.round(values[:, 3] * 4) / 4  # ties with thresholds
    labels = values[:, 0] + 0.5 * values[:, 3] ** 2 + rng.normal(0, 0.5, 3000) > 0.3
    return values, labels


@pytest.fixture(scope="module")
def grown(samples):
    classifier = RandomForestClassifier(7, min_samples_leaf=20, max_leaf_nodes=60, random_state=0).fit(
        *samples
    )
    return classifier, as_forest(classifier)


def test_probabilities_are_scikit_learns(samples, grown):
    classifier, forest = grown
    values, _ = samples
    thresholds = forest.threshold[forest.feature == 3]
    on_thresholds = np.repeat(values[:1], len(thresholds), axis=0)
    on_thresholds[:, 3] = thresholds
    for each in (values, on_thresholds, values * 100):
        np.testing.assert_allclose(forest.probability(each), classifier.predict_proba(each)[:, 1], atol=1e-6)


def named_features(*inputs: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(FEATURES, np.moveaxis(confidence_features(*inputs), 2, 0), strict=True))


def test_features_are_what_their_names_say():
    problem = random_problem(15, 21, 3, "blocks")
    disparity = (problem.disparity / 20).astype(np.float32)
    consistency = np.random.default_rng(1).uniform(-1, 3, (15, 21)).astype(np.float32)
    got = named_features(disparity, consistency, problem.image)
    np.testing.assert_array_equal(got["left_right_difference"], consistency)
    for y, x in ((7, 9), (6, 12)):
        for radius in (2, 3, 4):
            window = disparity[y - radius : y + radius + 1, x - radius : x + radius + 1].astype(float)
            size = 2 * radius + 1
            assert got[f"variance_{size}"][y, x] == pytest.approx(window.var(), rel=1e-4)
            median = abs(np.median(window) - disparity[y, x])
            assert got[f"median_deviation_{size}"][y, x] == pytest.approx(median, abs=1e-5)
    jumps = [
        (y, x)
        for y in range(15)
        for x in range(21)
        for v, u in ((y, x + 1), (y, x - 1), (y + 1, x), (y - 1, x))
        if 0 <= v < 15 and 0 <= u < 21 and abs(float(disparity[v, u]) - float(disparity[y, x])) > 1
    ]
    nearest = min(np.hypot(7 - y, 9 - x) for y, x in jumps)
    assert got["disparity_edge_distance"][7, 9] == pytest.approx(nearest, abs=1e-4)
    assert (got["left_border_distance"][4] == np.arange(21)).all()
    assert got["border_distance"][7, 9] == 5
    assert (got["border_distance"][1, 1:-1] == 1).all()
    ramp = np.repeat(np.arange(0, 210, 10, np.uint8)[None, :, None], 15, axis=0).repeat(3, axis=2)
    level = named_features(disparity, consistency, ramp)
    np.testing.assert_allclose(level["image_gradient"][1:-1, 1:-1], 10, atol=1e-4)
    np.testing.assert_allclose(level["image_edge_distance"], np.hypot(15, 21), rtol=1e-6)


def test_holes_and_tiny_images_have_features():
    for shape in ((1, 1), (1, 7), (9, 8)):
        image = np.zeros((*shape, 3), np.uint8)
        disparity = np.full(shape, np.nan, np.float32)
        assert np.isfinite(confidence_features(disparity, np.full(shape, -1, np.float32), image)).all()


def forest_frame(seed: int) -> ForestFrame:
    frame = toy_frame(seed)
    rng = np.random.default_rng(seed)
    wrong = np.abs(frame.disparity - frame.truth) > 1
    consistency = np.where(wrong, rng.uniform(0, 9, wrong.shape), rng.uniform(0, 1, wrong.shape))
    return ForestFrame(frame.image, frame.truth, frame.disparity, consistency.astype(np.float32))


def test_a_grown_forest_sorts_pixels_it_has_not_seen():
    config = ForestConfig(trees=10, samples=6000, leaf_samples=10)
    forest = grow_forest((forest_frame(seed) for seed in range(3)), 3, config, seed=0)
    again = grow_forest((forest_frame(seed) for seed in range(3)), 3, config, seed=0)
    frame = forest_frame(9)
    confidence = forest.confidence(frame.disparity, frame.consistency, frame.image)
    np.testing.assert_array_equal(
        again.confidence(frame.disparity, frame.consistency, frame.image), confidence
    )
    assert confidence.shape == frame.truth.shape
    areas = [
        sparsification_curve(frame.disparity, frame.truth, each).auc
        for each in (confidence, np.random.default_rng(0).random(confidence.shape))
    ]
    assert areas[0] < 0.4 * areas[1]


def test_nothing_to_learn_from_is_an_error():
    frame = forest_frame(0)
    right = replace(frame, disparity=frame.truth)
    with pytest.raises(ValueError, match="right and wrong"):
        grow_forest([right], 1, ForestConfig(trees=1, samples=100), 0)
    with pytest.raises(ValueError, match="right and wrong"):
        grow_forest([], 1, ForestConfig(trees=1, samples=100), 0)


def test_the_file_gives_back_the_forest(tmp_path, grown):
    path = tmp_path / "run" / "rdf.safetensors"
    save_forest(path, grown[1], {"data": ["worlds"]})
    loaded = load_forest(path)
    for name in Forest.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(grown[1], name))


@pytest.mark.parametrize(
    ("name", "index", "value", "reason"),
    [
        ("left", 0, 10**6, "lead nowhere"),
        ("right", 0, 0, "lead nowhere"),
        ("feature", 0, 12, "lead nowhere"),
        ("roots", 0, -1, "lead nowhere"),
        ("value", 0, np.nan, "lead nowhere"),
        ("value", slice(-1), None, "do not fit together"),
        ("left", None, np.float32, "arrays of a forest"),
    ],
)
def test_forests_that_cannot_be_walked_are_refused(tmp_path, grown, name, index, value, reason):
    import json

    path = tmp_path / "rdf.safetensors"
    save_forest(path, grown[1], {})
    arrays = load_file(path)
    if value is None:
        arrays[name] = arrays[name][index].copy()
    elif index is None:
        arrays[name] = arrays[name].astype(value)
    else:
        arrays[name][index] = value
    save_file(arrays, path, {"format": "1", "features": json.dumps(FEATURES), "about": "{}"})
    with pytest.raises(ForestError, match=reason):
        load_forest(path)


def test_other_files_are_refused(tmp_path, grown):
    path = tmp_path / "rdf.safetensors"
    with pytest.raises(ForestError, match=r"rdf\.safetensors: cannot be read"):
        load_forest(path)
    save_forest(path, grown[1], {})
    content = path.read_bytes()
    for damaged in (b"", content[:-7], b"\x80\x04N."):
        path.write_bytes(damaged)
        with pytest.raises(ForestError, match="cannot be read"):
            load_forest(path)
    save_file({"a": np.zeros(3, np.float32)}, path, {"format": "1"})
    with pytest.raises(ForestError, match="12 features"):
        load_forest(path)
