"""The MRF with a robust gradient term against the minimum of its energy, found by other means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refine import MRFParameters, refine_disparity, solve_mrf
from refine.energy.confidence_shape import ConfidenceShape
from refine.methods.ours import Ours
from refine.methods.ours_quadratic import OursQuadratic
from refine.mrf import robust
from refine.mrf.robust import gradient_factor, solve_robust
from tests.refine.oracles import robust_energy, robust_minimiser
from tests.refine.worlds import random_problem, toy_frame

MILD = MRFParameters(alpha=5.0, beta=0.1, sigma_r=20.0, confidence_floor=0.05)
"""Weights whose energy a quasi-Newton method gets to the bottom of."""


@settings(max_examples=25, deadline=None)
@given(
    height=st.integers(2, 6),
    width=st.integers(2, 6),
    seed=st.integers(0, 10**6),
    style=st.sampled_from(["noise", "smooth", "constant", "blocks"]),
    scale=st.sampled_from([0.3, 2.0, 20.0]),
)
def test_reweighting_ends_at_the_minimum_of_the_energy(height, width, seed, style, scale):
    problem = random_problem(height, width, seed, style)
    found = solve_robust(*problem.inputs, MILD, scale, reweightings=300).disparity
    np.testing.assert_allclose(found, robust_minimiser(problem, MILD, scale), rtol=0, atol=2e-3)


@pytest.mark.parametrize("style", ["smooth", "blocks"])
def test_weighing_ahead_ends_lower_than_one_more_solve_does(style, monkeypatch):
    problem = random_problem(30, 40, seed=5, style=style)
    energy = robust_energy(problem, MILD, 0.3)
    ahead = energy(solve_robust(*problem.inputs, MILD, 0.3).disparity.ravel())[0]
    monkeypatch.setattr(robust, "AHEAD", 0.0)
    plain = solve_robust(*problem.inputs, MILD, 0.3, robust.DEFAULT_REWEIGHTINGS + 1)
    assert ahead < energy(plain.disparity.ravel())[0]


@pytest.mark.parametrize("solver", ["cg", "multigrid"])
def test_iterative_solvers_agree_with_the_direct_one(solver):
    """On more rows than the couplings are made of at once, and with slopes that are not known."""
    problem = random_problem(150, 40, seed=3)
    problem.gradient[70:80, 5:9] = np.nan
    found, expected = (
        solve_robust(*problem.inputs, MILD, 0.5, 3, name, 1e-10) for name in (solver, "direct")
    )
    # The first solves stop at 1e-4, which moves the weights of the last.
    np.testing.assert_allclose(found.disparity, expected.disparity, rtol=0, atol=5e-3)
    assert found.info.solver == solver
    assert found.info.iterations > 4


def test_it_is_the_quadratic_mrf_without_reweightings_and_for_a_large_scale():
    problem = random_problem(20, 30, seed=4)
    quadratic = solve_mrf(*problem.inputs, MILD).disparity
    np.testing.assert_array_equal(solve_robust(*problem.inputs, MILD, 0.3, 0).disparity, quadratic)
    np.testing.assert_allclose(solve_robust(*problem.inputs, MILD, 1e5, 3).disparity, quadratic, atol=1e-5)
    assert np.abs(solve_robust(*problem.inputs, MILD, 0.3, 3).disparity - quadratic).max() > 0.5


def test_factors_worked_out_by_hand():
    disparity = np.array([[0.0, 3.0], [4.0, 7.0]])
    gradient = np.array([[[0.0, 0.0], [9.0, np.nan]], [[3.0, 9.0], [9.0, 9.0]]])
    factor = gradient_factor(disparity, gradient, 3.0)
    root = 1 / np.sqrt(2)
    np.testing.assert_allclose(factor[..., 0], [[root, 1], [1, 1]])  # the last column has no neighbour
    np.testing.assert_allclose(factor[..., 1], [[0.6, 1], [1, 1]])  # an unknown slope asks for nothing


def test_a_step_that_the_image_does_not_show_stays_a_step():
    """Box and background of one colour: the quadratic term smears what the robust one leaves alone."""
    frame = replace(toy_frame(0), image=np.full((48, 80, 3), 128, np.uint8))
    parameters = MRFParameters(alpha=100.0)
    assert frame.confidence is not None
    assert frame.gradient is not None
    inputs = frame.disparity, frame.confidence, frame.gradient, frame.image
    quadratic = np.abs(refine_disparity(*inputs, parameters) - frame.truth)
    robust = np.abs(solve_robust(*inputs, parameters, 0.1).disparity - frame.truth)
    assert robust.mean() < 0.7 * quadratic.mean()
    assert (robust > 1).sum() < 0.7 * (quadratic > 1).sum()


def test_ours_is_the_quadratic_mrf_or_this_one_as_its_scale_says():
    frame, shape = toy_frame(1), ConfidenceShape(power=2.0)
    assert frame.confidence is not None
    assert frame.gradient is not None
    inputs = frame.disparity, shape.apply(frame.confidence), frame.gradient, frame.image, MILD
    quadratic, robust = solve_mrf(*inputs).disparity, solve_robust(*inputs, 0.1).disparity
    assert np.abs(quadratic - robust).max() > 0.1
    for method, expected in (
        (Ours(MILD, shape, gradient_scale=0.1), robust),
        (Ours(MILD, shape), quadratic),
        (OursQuadratic(MILD, shape), quadratic),
    ):
        np.testing.assert_array_equal(method.run(frame).disparity, expected.astype(np.float32))


def test_its_deviation_is_that_of_the_gaussian_at_its_minimum():
    """Against the inverse of the energy's second derivatives, by differences of its slope."""
    problem = random_problem(9, 11, seed=2, style="blocks")
    method = Ours(MILD, gradient_scale=0.5)
    refined = method.solve(*problem.inputs).disparity.ravel()
    slope = robust_energy(problem, MILD, 0.5)
    step = 1e-4
    curvature = [
        (slope(refined + step * unit)[1] - slope(refined - step * unit)[1]) / (2 * step)
        for unit in np.eye(refined.size)
    ]
    exact = np.sqrt(np.diag(np.linalg.inv(curvature))).reshape(9, 11)
    error = method.sample(*problem.inputs, samples=512) / exact - 1
    assert np.sqrt((error**2).mean()) < 1.5 / 32  # 1 / sqrt(2 * 512)
    quadratic = Ours(MILD).sample(*problem.inputs, samples=512) / exact - 1
    assert np.sqrt((quadratic**2).mean()) > 4 / 32


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"scale": 0.0}, "scale must be positive, got 0.0"),
        ({"scale": np.nan}, "scale must be positive, got nan"),
        ({"reweightings": -1}, "there cannot be -1 reweightings"),
        ({"solver": "magic"}, "solver is one of"),
        ({"tolerance": 0.0}, "tolerance must be between 0 and 1"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, complaint):
    problem = random_problem(5, 6, seed=0)
    with pytest.raises(ValueError, match=complaint):
        solve_robust(*problem.inputs, **{"parameters": MILD, "scale": 0.3, **changes})


def test_methods_refuse_a_scale_that_they_cannot_have():
    for scale in (0.0, -1.0, np.inf):
        with pytest.raises(ValueError, match="scale must be positive"):
            Ours(gradient_scale=scale)
    with pytest.raises(ValueError, match="quadratic gradient term"):
        Ours(form="paper", gradient_scale=0.3)
    with pytest.raises(ValueError, match="quadratic gradient term"):
        OursQuadratic(gradient_scale=0.3)
