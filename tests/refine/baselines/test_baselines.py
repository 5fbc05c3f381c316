"""Every baseline against an oracle that shares no code with it."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from refine import MRFParameters, refine_disparity
from refine.baselines.color import Color
from refine.baselines.fbs import FBS
from refine.baselines.grad import Grad
from refine.baselines.regressor_f import RegressorF
from refine.baselines.sgbm import SGBM
from refine.baselines.tgv import TGV
from refine.baselines.wmf import WMF, weighted_median
from refine.energy.confidence_shape import ConfidenceShape
from refine.evaluation.evaluate import EvaluationFrame, evaluate
from refine.methods.ours import Ours
from refine.methods.ours_conf_gt import OursConfGT
from refine.registry import default_methods, known_methods
from stereoforge_kit.matching import SGBMParameters
from tests.refine.oracles import dense_minimiser
from tests.refine.worlds import random_problem, toy_frame
from tests.training.synthetic import random_pair


def frame_of(height: int, width: int, seed: int, style: str = "mixed") -> EvaluationFrame:
    problem = random_problem(height, width, seed, style)
    return EvaluationFrame(
        name=f"{style} {seed}",
        image=problem.image,
        truth=problem.disparity.astype(np.float32),
        occlusion=np.zeros((height, width), np.uint8),
        disparity=problem.disparity.astype(np.float32),
        confidence=problem.confidence.astype(np.float32),
        gradient=problem.gradient.astype(np.float32),
    )


# Weighted median


def median_by_sorting(
    values: np.ndarray, image: np.ndarray, radius: int, sigma: float, share: float
) -> np.ndarray:
    """The least value of each window at which the weights up to it reach a share of their sum."""
    height, width = values.shape
    result = np.full_like(values, np.nan)
    for y in range(height):
        for x in range(width):
            window = []
            for v in range(max(0, y - radius), min(height, y + radius + 1)):
                for u in range(max(0, x - radius), min(width, x + radius + 1)):
                    if not math.isnan(values[v, u]):
                        squared = sum(
                            (float(a) - float(b)) ** 2 for a, b in zip(image[y, x], image[v, u], strict=True)
                        )
                        window.append((values[v, u], math.exp(-squared / (2 * sigma**2))))
            window.sort()
            wanted, passed = share * sum(weight for _, weight in window), 0.0
            for value, weight in window:
                passed += weight
                if passed >= wanted:
                    result[y, x] = value
                    break
    return result


@settings(max_examples=25, deadline=None)
@example(height=5, width=8, radius=1, sigma=5.0, holes=0.0, coarse=False, seed=59)
@given(
    height=st.integers(1, 9),
    width=st.integers(1, 9),
    radius=st.integers(0, 4),
    sigma=st.sampled_from([5.0, 25.5]),
    holes=st.sampled_from([0.0, 0.3, 1.0]),
    coarse=st.booleans(),
    seed=st.integers(0, 99),
)
def test_weighted_median_equals_sorting(height, width, radius, sigma, holes, coarse, seed):
    """Ties included: coarse values repeat, on a constant image with equal weights.

    Where the weights up to a value are half of the sum but for rounding, the order of summation decides whether that
    value or the next one is the median; both are right there, and nowhere else do the two oracles differ.
    """
    rng = np.random.default_rng(seed)
    problem = random_problem(height, width, seed, "constant" if coarse else "mixed")
    values = np.rint(problem.disparity / 20) if coarse else problem.disparity
    values = np.where(rng.random((height, width)) < holes, np.nan, values).astype(np.float32)
    low, high = (median_by_sorting(values, problem.image, radius, sigma, 0.5 + r) for r in (-1e-12, 1e-12))
    found = weighted_median(values, problem.image, radius, sigma)
    np.testing.assert_array_equal(found, np.where(found == high, high, low))


def test_the_library_quantises_where_ours_does_not():
    """OpenCV's filter agrees but for its 256 bins and clusters: why it is not used."""
    frame = frame_of(24, 32, 3, "blocks")
    library = cv2.ximgproc.weightedMedianFilter(frame.image, frame.disparity, 3, sigma=25.5)
    ours = WMF(radius_px=3).run(frame).disparity
    assert np.median(np.abs(library - ours)) < 60 / 256
    assert (library != ours).mean() > 0.25


# Colour and gradient terms alone


def test_color_and_grad_are_the_mrf_without_the_other_term():
    problem = random_problem(6, 7, 5)
    frame = frame_of(6, 7, 5)
    color = dense_minimiser(problem, MRFParameters(0.0, 2.0, 4.0, 1e-2))
    np.testing.assert_allclose(
        Color(beta=2.0, sigma_r=4.0, confidence_floor=1e-2).run(frame).disparity, color, atol=1e-3
    )
    grad = dense_minimiser(problem, MRFParameters(30.0, 0.0, 4.0, 1e-2))
    np.testing.assert_allclose(
        Grad(alpha=30.0, sigma_r=4.0, confidence_floor=1e-2).run(frame).disparity, grad, atol=1e-3
    )


def test_color_of_large_images_is_that_of_small_ones(monkeypatch):
    frame = frame_of(90, 120, 3)
    color = Color(beta=100.0, sigma_r=0.1)
    factorised = color.run(frame).disparity
    monkeypatch.setattr("refine.baselines.color._DIRECT_UP_TO_PIXELS", 0)
    np.testing.assert_allclose(color.run(frame).disparity, factorised, atol=0.05)


def test_colors_unsquared_form_is_eq_8_and_its_small_sigma_is_levins():
    frame = frame_of(6, 7, 1, "noise")
    level = np.zeros((6, 7, 2))
    printed = refine_disparity(
        frame.disparity, frame.confidence, level, frame.image, MRFParameters(0.0, 1.0), form="paper"
    )
    np.testing.assert_allclose(Color(form="paper").run(frame).disparity, printed, atol=1e-4)
    # Where all phi are 0 the prior has weight 2 everywhere, whatever sigma_r.
    results = [Color(sigma_r=sigma).run(frame).disparity for sigma in (0.1, 0.2)]
    np.testing.assert_allclose(*results, atol=1e-4)


def test_shapes_of_confidence():
    confidence = np.array([[0.0, 0.1, 0.5, 0.8, 1.0]], np.float32)
    np.testing.assert_allclose(ConfidenceShape(power=2).apply(confidence), confidence**2, atol=1e-6)
    logits = np.log(confidence[0, 1:-1] / (1 - confidence[0, 1:-1]))
    softened = ConfidenceShape(temperature=2).apply(confidence)[0]
    np.testing.assert_allclose(softened[1:-1], 1 / (1 + np.exp(-logits / 2)), atol=1e-6)
    assert (softened[[0, -1]] == [0, 1]).all()
    with pytest.raises(ValueError, match="temperature must be positive"):
        ConfidenceShape(temperature=0)


def test_ours_shapes_its_confidence():
    frame = toy_frame(0, 20, 24)
    squared = refine_disparity(frame.disparity, frame.confidence.clip(0, 1) ** 2, frame.gradient, frame.image)
    got = Ours(shape=ConfidenceShape(power=2)).run(replace(frame, confidence=frame.confidence.clip(0, 1)))
    np.testing.assert_allclose(got.disparity, squared, atol=1e-3)


# Fast bilateral solver


def dense_bilateral_solution(frame: EvaluationFrame, method: FBS) -> np.ndarray:
    """The solver's published equation over a dictionary of vertices, dense, with numpy's own solver."""
    height, width = frame.disparity.shape
    vertices: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for y in range(height):
        for x in range(width):
            r, g, b = (Fraction(int(c)) for c in frame.image[y, x])
            luma = (299 * r + 587 * g + 114 * b) / 1000
            cb = 128 + (-168736 * r - 331264 * g + 500000 * b) / 1000000
            cr = 128 + (500000 * r - 418688 * g - 81312 * b) / 1000000
            sides = (method.sigma_spatial_px,) * 2 + (method.sigma_luma,) + (method.sigma_chroma,) * 2
            place = zip((x, y, luma, cb, cr), sides, strict=True)
            cell = tuple(math.floor(value / Fraction(side)) for value, side in place)
            vertices.setdefault(cell, []).append((y, x))
    cells = list(vertices)
    blur = np.zeros((len(cells), len(cells)))
    for i, one in enumerate(cells):
        for j, other in enumerate(cells):
            apart = [abs(a - b) for a, b in zip(one, other, strict=True)]
            blur[i, j] = 10 if i == j else float(sum(apart) == 1)
    count = np.array([len(pixels) for pixels in vertices.values()], float)
    scale = np.ones(len(cells))
    for _ in range(10):
        scale = np.sqrt(scale * count / (blur @ scale))
    mass = scale * (blur @ scale)
    trust = np.maximum(np.where(np.isnan(frame.disparity), 0, frame.confidence), method.confidence_floor)
    known = np.nan_to_num(frame.disparity)
    data = np.array([sum(trust[p] for p in pixels) for pixels in vertices.values()])
    wanted = np.array([sum(trust[p] * known[p] for p in pixels) for pixels in vertices.values()])
    a = method.smoothness * (np.diag(mass) - np.diag(scale) @ blur @ np.diag(scale)) + np.diag(data)
    solution = np.linalg.solve(a, wanted)
    result = np.empty((height, width))
    for value, pixels in zip(solution, vertices.values(), strict=True):
        for pixel in pixels:
            result[pixel] = value
    return result


@pytest.mark.parametrize("style", ["noise", "smooth", "constant", "blocks"])
@pytest.mark.parametrize("method", [FBS(), FBS(4.0, 8.0, 16.0, 8.0, 1e-2)])
def test_bilateral_solver_agrees_with_a_dense_computation(style, method):
    frame = frame_of(13, 17, 2, style)
    expected = dense_bilateral_solution(frame, method)
    np.testing.assert_allclose(method.run(frame).disparity, expected, atol=0.01)


def test_the_affinity_is_bistochastic_enough():
    """Every pixel's affinities sum to 1: with more of the published iterations, as closely as one likes."""
    from refine.baselines.fbs import bilateral_grid, bistochastic

    splat, blur = bilateral_grid(random_problem(20, 24, 0, "blocks").image, (4.0, 16.0, 16.0))
    pixels = np.asarray(splat.sum(axis=1))
    errors = [np.abs(bistochastic(splat, blur, n)[1] / pixels - 1).max() for n in (10, 40)]
    assert errors[1] < 1e-6 < errors[0] < 0.1


# TGV


class DenseTGV:
    """TGV's energy written out term by term from its definition, sharing nothing with the method: x holds the
    disparities, then the slopes to the right, then those downwards."""

    def __init__(self, frame: EvaluationFrame, method: TGV) -> None:
        height, width = self.shape = frame.disparity.shape
        size = height * width
        self.target = frame.disparity.ravel().astype(float)
        self.weight = method.data_weight * frame.confidence.ravel().astype(float)
        place = np.arange(size).reshape(height, width)
        tensors = self.tensors(frame.image, method.tensor_strength, method.tensor_exponent)
        norms: list[tuple[float, np.ndarray]] = []
        for y in range(height):
            for x in range(width):
                steps = np.zeros((2, 3 * size))
                bends = np.zeros((4, 3 * size))
                for axis, (ny, nx) in enumerate(((y, x + 1), (y + 1, x))):
                    if ny < height and nx < width:
                        steps[axis, [place[ny, nx], place[y, x]]] = 1, -1
                        steps[axis, (1 + axis) * size + place[y, x]] = -1
                        for c in (0, 1):
                            bends[2 * axis + c, (1 + c) * size + place[ny, nx]] = 1
                            bends[2 * axis + c, (1 + c) * size + place[y, x]] = -1
                norms += [(method.alpha1, tensors[y][x] @ steps), (method.alpha0, bends)]
        self.norms = [(alpha, rows) for alpha, rows in norms if rows.any()]

    @staticmethod
    def tensors(image: np.ndarray, strength: float, exponent: float) -> list[list[np.ndarray]]:
        bell = np.exp(-2.0 * np.arange(-2, 3) ** 2)
        bell /= bell.sum()
        grey = np.pad(image.astype(float).sum(axis=2) / 765, 2, mode="edge")
        grey = np.array([np.convolve(row, bell, "valid") for row in grey])
        grey = np.array([np.convolve(column, bell, "valid") for column in grey.T]).T
        height, width = grey.shape
        made: list[list[np.ndarray]] = []
        for y in range(height):
            made.append([])
            for x in range(width):
                right, below = grey[y, min(x + 1, width - 1)], grey[min(y + 1, height - 1), x]
                slope = np.array([right, below]) - grey[y, x]
                size = np.linalg.norm(slope)
                normal = slope / size if size > 1e-8 else np.array([1.0, 0.0])
                across = np.outer(normal, normal)
                made[-1].append(np.exp(-strength * size**exponent) * across + np.eye(2) - across)
        return made

    def energy(self, x: np.ndarray, rounding: float = 0.0) -> float:
        """Norms are sqrt(|.|^2 + rounding^2): too large by at most `rounding` each."""
        off = x[: self.target.size] - self.target
        sizes = (alpha * np.sqrt(((rows @ x) ** 2).sum() + rounding**2) for alpha, rows in self.norms)
        return float(0.5 * (self.weight * off**2).sum() + sum(sizes))

    def slope(self, x: np.ndarray, rounding: float) -> np.ndarray:
        """The energy's gradient."""
        gradient = np.zeros_like(x)
        gradient[: self.target.size] = self.weight * (x[: self.target.size] - self.target)
        for alpha, rows in self.norms:
            value = rows @ x
            gradient += alpha * rows.T @ value / np.sqrt(value @ value + rounding**2)
        return gradient

    def curvature(self, x: np.ndarray, rounding: float) -> np.ndarray:
        """Its Hessian."""
        hessian = np.zeros((x.size, x.size))
        hessian[np.diag_indices(self.target.size)] = self.weight
        for alpha, rows in self.norms:
            value = rows @ x
            size = np.sqrt(value @ value + rounding**2)
            used = np.flatnonzero(rows.any(axis=0))
            core = rows[:, used]
            bent = core.T @ (np.eye(len(value)) - np.outer(value, value) / size**2) @ core / size
            hessian[np.ix_(used, used)] += alpha * bent
        return hessian

    def minimiser(self) -> np.ndarray:
        """By scipy's trust region, the norms' corners rounded less and less."""
        x = np.concatenate([self.target, np.zeros(2 * self.target.size)])
        for rounding in 10.0 ** -np.arange(0, 4.5, 0.5):
            x = minimize(self.energy, x, (rounding,), "trust-exact", jac=self.slope, hess=self.curvature).x
        return x


def test_tgv_matches_a_reference_convex_solve():
    method = TGV(iterations=4000, tolerance_px=0.0)
    toy = frame_of(6, 8, 4, "blocks")
    target = (4 + np.arange(8) * 0.5 + (np.arange(8) > 4) * 9 + 0.2 * toy.disparity / 60).astype(np.float32)
    frame = replace(toy, disparity=np.broadcast_to(target, (6, 8)).copy())
    dense = DenseTGV(frame, method)
    expected = dense.minimiser()
    inputs = (frame.disparity, frame.confidence, frame.image)
    u, v = method.solve(*inputs)
    found = np.concatenate([u.ravel(), v[..., 0].ravel(), v[..., 1].ravel()]).astype(float)
    assert dense.energy(found) == pytest.approx(dense.energy(expected), rel=0.01)
    assert method.energy(u, v, *inputs) == pytest.approx(dense.energy(found), rel=1e-5)
    np.testing.assert_allclose(u, expected[: u.size].reshape(u.shape), atol=0.05)


def test_tgv_lowers_its_energy_and_keeps_planes():
    frame = toy_frame(1)
    inputs = (frame.disparity, frame.confidence, frame.image)
    energies = [
        TGV().energy(*replace(TGV(), iterations=n, tolerance_px=0.0).solve(*inputs), *inputs)
        for n in (10, 100, 500, 2000)
    ]
    level = np.zeros((*frame.disparity.shape, 2), np.float32)
    assert TGV().energy(frame.disparity, level, *inputs) > energies[0] > energies[1] > energies[2]
    assert energies[2] < 1.03 * energies[3]
    y, x = np.mgrid[:20, :30]
    plane = (5 + 0.3 * x + 0.2 * y).astype(np.float32)
    image = random_problem(20, 30, 0, "noise").image
    flat, _ = TGV(iterations=5000, tolerance_px=0.0).solve(plane, np.ones_like(plane), image)
    np.testing.assert_allclose(flat, plane, atol=0.02)


# All of them


def full_frame(seed: int = 0) -> EvaluationFrame:
    frame = toy_frame(seed)
    return replace(frame, right=np.roll(frame.image, -6, axis=1), fine_tuned=frame.truth + np.float32(0.25))


def test_every_method_runs_on_a_frame_and_is_timed():
    methods = [method() for method in known_methods().values()]
    frame = replace(full_frame(), seconds={"disparity": 2.0, "fine_tuned": 3.0})
    evaluation = evaluate([frame], methods)
    assert evaluation.skipped == {}
    assert set(evaluation.scores) == {
        *("regressor", "regressor_f", "gradnet", "sgbm", "wmf", "color", "tgv", "fbs", "grad", "ours"),
        *("ours_conf_gt", "ours_quadratic"),
    }
    assert all(score.seconds > 0 for score in evaluation.scores.values())
    assert evaluation.scores["regressor"].seconds == pytest.approx(2.0, abs=0.1)
    assert evaluation.scores["regressor_f"].seconds == pytest.approx(3.0, abs=0.1)
    assert evaluation.scores["regressor_f"].regions["all"].epe == pytest.approx(0.25)
    before = evaluation.scores["regressor"].regions["all"].epe
    for name in ("color", "tgv", "fbs", "grad", "ours", "ours_conf_gt", "ours_quadratic"):
        assert evaluation.scores[name].regions["all"].epe < before, name


@pytest.mark.parametrize(
    "method",
    [
        *default_methods(("wmf", "color", "tgv", "fbs", "grad", "ours_quadratic")),
        Ours(gradient_scale=0.1),
    ],
    ids=lambda method: method.name,
)
def test_holes_and_tiny_images_are_taken(method):
    frame = full_frame()
    disparity = frame.disparity.copy()
    disparity[5:9, 10:60] = np.nan
    filled = method.run(replace(frame, disparity=disparity)).disparity
    assert np.isfinite(filled).all()
    assert np.abs(filled - frame.truth)[:, 60:].mean() < 8
    for height, width in ((1, 1), (1, 9), (9, 1)):
        frame = frame_of(height, width, 0)
        result = method.run(frame).disparity
        assert result.shape == (height, width)
        assert result.dtype == np.float32
        assert np.isfinite(result).all()


def test_search_values_are_fields_and_hold_the_defaults():
    for name, kind in known_methods().items():
        for path, values in kind.search.items():
            value = kind()
            for part in path.split("."):
                value = getattr(value, part)
            assert value in values, f"{name}: {path} = {value} is not among {values}"


def test_sgbm_row_fills_its_holes():
    pair = random_pair(np.random.default_rng(0), 64, 128)
    frame = EvaluationFrame(
        "pair",
        pair.left,
        pair.disparity_left,
        np.zeros((64, 128), np.uint8),
        pair.disparity_left,
        right=pair.right,
    )
    found = SGBM(SGBMParameters(max_disparity_px=48)).run(frame).disparity
    assert np.isfinite(found).all()
    assert np.median(np.abs(found - pair.disparity_left)) < 0.5
    assert RegressorF().missing(frame) == ("fine_tuned",)


def test_the_upper_bound_follows_the_mrf_it_is_given():
    frame = toy_frame(0, 20, 24)
    weak = OursConfGT(mrf=Ours(MRFParameters(alpha=1e-6, beta=1e-6))).run(frame).disparity
    right = np.abs(frame.disparity - frame.truth) <= 1
    np.testing.assert_allclose(weak[right], frame.disparity[right], atol=0.05)
