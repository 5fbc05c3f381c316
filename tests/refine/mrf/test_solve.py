"""The refinement against dense solutions of the energy and of Eq. 8, both built here by loops."""

from __future__ import annotations

import doctest
import sys
import warnings

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from refine import ConvergenceWarning, MRFParameters, SolverError, refine_disparity, solve_mrf
from refine.energy.affinity import NEIGHBORS
from refine.metrics import forward_gradient
from tests.refine.oracles import dense_minimiser, dense_paper_solution
from tests.refine.worlds import Problem, random_problem, toy_frame

TIGHT = 1e-10
# The iterative solvers keep their coefficients in single precision.
WITHIN = {"direct": 1e-8, "cg": 1e-4, "multigrid": 1e-4}
STYLES = ["noise", "smooth", "constant", "blocks", "mixed"]
DEFAULTS = MRFParameters()


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("solver", ["direct", "cg", "multigrid"])
def test_exact_form_minimises_the_energy(style, solver):
    problem = random_problem(12, 9, seed=3, style=style)
    solution = solve_mrf(*problem.inputs, solver=solver, tolerance=TIGHT)
    np.testing.assert_allclose(
        solution.disparity, dense_minimiser(problem, DEFAULTS), rtol=0, atol=WITHIN[solver]
    )
    assert not solution.info.fell_back
    assert solution.info.solver == solver


@pytest.mark.parametrize("shape", [(12, 31), (31, 12), (1, 9), (9, 1)])
def test_a_band_and_superlu_factorise_the_same_matrix(shape, monkeypatch):
    """What is too large for a band goes to SuperLU, with the same answer."""
    problem = random_problem(*shape, seed=6, style="mixed")
    banded = solve_mrf(*problem.inputs, solver="direct").disparity
    monkeypatch.setattr("refine.solvers.direct.BAND_ENTRIES", 0)
    monkeypatch.setattr("refine.solvers.direct.cholesky_banded", None)
    np.testing.assert_allclose(solve_mrf(*problem.inputs, solver="direct").disparity, banded, atol=1e-9)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("solver", ["direct", "cg", "multigrid"])
def test_paper_form_solves_equation_8(style, solver):
    problem = random_problem(12, 9, seed=4, style=style)
    solution = solve_mrf(*problem.inputs, form="paper", solver=solver, tolerance=TIGHT)
    np.testing.assert_allclose(
        solution.disparity, dense_paper_solution(problem, DEFAULTS), rtol=0, atol=WITHIN[solver]
    )
    assert not solution.info.fell_back


def test_the_two_forms_differ():
    problem = random_problem(12, 9, seed=5)
    exact, paper = (refine_disparity(*problem.inputs, form=form) for form in ("exact", "paper"))
    assert np.abs(exact - paper).max() > 0.1


@settings(max_examples=60, deadline=None)
@given(
    height=st.integers(1, 8),
    width=st.integers(1, 8),
    seed=st.integers(0, 10**6),
    style=st.sampled_from(STYLES),
    alpha=st.sampled_from([0.0, 1.0, 100.0]),
    beta=st.sampled_from([0.0, 0.1, 10.0]),
    form=st.sampled_from(["exact", "paper"]),
)
def test_any_size_and_weights_agree_with_the_dense_solution(height, width, seed, style, alpha, beta, form):
    problem = random_problem(height, width, seed, style)
    parameters = MRFParameters(alpha=alpha, beta=beta)
    expected = {"exact": dense_minimiser, "paper": dense_paper_solution}[form](problem, parameters)
    found = solve_mrf(*problem.inputs, parameters, form=form).disparity
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("form", ["exact", "paper"])
@pytest.mark.parametrize("solver", ["direct", "cg", "multigrid"])
def test_a_plane_with_its_own_gradient_is_reproduced_where_the_colour_term_allows(form, solver):
    y, x = np.mgrid[:20, :31].astype(float)
    plane = 5 + 0.3 * x - 0.2 * y + 10
    gradient = np.nan_to_num(forward_gradient(plane))
    image = np.full((20, 31, 3), 90, np.uint8)
    confidence = np.where((x + y) % 7 == 0, 1.0, 0.0)
    noisy = np.where(confidence > 0, plane, 50.0)
    parameters = MRFParameters(confidence_floor=0.0)
    found = solve_mrf(noisy, confidence, gradient, image, parameters, form, solver, TIGHT)
    np.testing.assert_allclose(found.disparity, plane, rtol=0, atol=WITHIN[solver])


@pytest.mark.parametrize("form", ["exact", "paper"])
@pytest.mark.parametrize("style", ["noise", "blocks", "constant"])
def test_a_constant_disparity_is_reproduced_on_any_image(form, style):
    problem = random_problem(15, 14, seed=6, style=style)
    constant = np.full((15, 14), 17.25)
    refined = refine_disparity(constant, problem.confidence, np.zeros((15, 14, 2)), problem.image, form=form)
    np.testing.assert_allclose(refined, 17.25, rtol=0, atol=1e-5)
    assert refined.dtype == np.float32


@pytest.mark.parametrize("form", ["exact", "paper"])
def test_solvers_agree_on_an_image_of_some_size(form):
    problem = random_problem(70, 90, seed=7)
    solutions = [
        solve_mrf(*problem.inputs, form=form, solver=solver, tolerance=1e-9)
        for solver in ("direct", "cg", "multigrid")
    ]
    for solution in solutions[1:]:
        np.testing.assert_allclose(solution.disparity, solutions[0].disparity, atol=1e-3)
        assert solution.info.iterations > 0
        assert solution.info.relative_residual <= 2e-9


@settings(max_examples=60, deadline=None)
@given(
    height=st.integers(1, 17),
    width=st.integers(1, 17),
    seed=st.integers(0, 10**6),
    style=st.sampled_from(STYLES),
    known=st.sampled_from(["everywhere", "half", "one pixel"]),
    form=st.sampled_from(["exact", "paper"]),
)
@example(height=16, width=1, seed=1636, style="blocks", known="half", form="paper")  # off by 0.0029
def test_multigrid_agrees_with_the_dense_solution_however_little_is_known(
    height, width, seed, style, known, form
):
    problem = random_problem(height, width, seed, style)
    confidence = problem.confidence.copy()
    if known == "half":
        confidence[problem.confidence < 0.5] = 0
    elif known == "one pixel":
        confidence[...] = 0
        confidence[height // 2, width // 3] = 1
    problem = Problem(problem.disparity, confidence, problem.gradient, problem.image)
    expected = {"exact": dense_minimiser, "paper": dense_paper_solution}[form](problem, DEFAULTS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solution = solve_mrf(*problem.inputs, form=form, solver="multigrid", tolerance=1e-9)
    # Coefficients are rounded to float32, and what ties pixels together is up to 10^5 times what holds them. The
    # paper's form was seen off by 0.0029 in one case, the one above.
    np.testing.assert_allclose(
        solution.disparity, expected, rtol=0, atol={"exact": 2e-3, "paper": 5e-3}[form]
    )


@pytest.mark.parametrize("style", ["blocks", "constant", "noise"])
def test_one_confident_pixel_without_a_floor_is_enough(style):
    problem = random_problem(61, 73, seed=21, style=style)
    confidence = np.zeros((61, 73))
    confidence[30, 20] = 1
    inputs = (problem.disparity, confidence, 0.1 * problem.gradient, problem.image)
    parameters = MRFParameters(confidence_floor=0.0)
    found = solve_mrf(*inputs, parameters, solver="multigrid", tolerance=1e-10)
    reference = solve_mrf(*inputs, parameters, solver="direct")
    assert not found.info.fell_back
    np.testing.assert_allclose(found.disparity, reference.disparity, rtol=0, atol=0.01)


def test_a_good_start_saves_iterations():
    problem = random_problem(70, 90, seed=22)
    first = solve_mrf(*problem.inputs, solver="multigrid")
    again = solve_mrf(*problem.inputs, solver="multigrid", x0=first.disparity)
    assert again.info.iterations < first.info.iterations / 4
    with pytest.raises(ValueError, match=r"x0 has shape \(3, 3\)"):
        solve_mrf(*problem.inputs, x0=np.zeros((3, 3)))


def test_multigrid_needs_far_fewer_iterations_than_jacobi():
    problem = random_problem(70, 90, seed=8)
    multigrid, jacobi = (
        solve_mrf(*problem.inputs, solver=solver, tolerance=1e-8).info.iterations
        for solver in ("multigrid", "cg")
    )
    assert multigrid * 4 < jacobi


def test_multigrid_stays_fast_where_nothing_is_confident_and_all_is_textured():
    problem = random_problem(120, 150, seed=14, style="noise")
    confidence = np.where(problem.confidence > 0.99, 1.0, 0.0)
    for form, limit in (("exact", 40), ("paper", 15)):
        info = solve_mrf(problem.disparity, confidence, problem.gradient, problem.image, form=form).info
        assert info.solver == "multigrid"
        assert info.iterations < limit


def test_auto_is_direct_on_small_images_and_multigrid_on_large_ones():
    assert solve_mrf(*random_problem(20, 20, 1).inputs).info.solver == "direct"
    assert solve_mrf(*random_problem(70, 70, 1).inputs).info.solver == "multigrid"


def test_missing_disparities_count_as_the_nearest_without_confidence():
    problem = random_problem(9, 11, seed=9)
    holes = problem.disparity.copy()
    holes[:, 4] = np.nan
    patched, confidence = problem.disparity.copy(), problem.confidence.copy()
    patched[:, 4] = patched[:, 3]
    confidence[:, 4] = 0
    found = solve_mrf(holes, problem.confidence, problem.gradient, problem.image).disparity
    either = []
    for column in (3, 5):
        patched[:, 4] = problem.disparity[:, column]
        either.append(
            dense_minimiser(Problem(patched, confidence, problem.gradient, problem.image), DEFAULTS)
        )
    assert min(np.abs(found - expected).max() for expected in either) < 1e-8


def test_a_single_known_pixel_carries_the_whole_image():
    problem = random_problem(13, 10, seed=10, style="smooth")
    holes = np.full((13, 10), np.nan)
    holes[6, 4] = 30.0
    refined = refine_disparity(holes, np.ones((13, 10)), np.zeros((13, 10, 2)), problem.image)
    np.testing.assert_allclose(refined, 30.0, atol=1e-4)


def test_a_gradient_that_is_not_known_leaves_its_difference_free():
    image = np.full((6, 8, 3), 100, np.uint8)
    step = np.where(np.arange(8) < 4, 10.0, 20.0) * np.ones((6, 1))
    gradient = np.zeros((6, 8, 2))
    gradient[:, 3, 0] = np.nan
    found = refine_disparity(step, np.ones((6, 8)), gradient, image)
    np.testing.assert_allclose(found, step, atol=1e-4)
    gradient[:, 3, 0] = 0.0
    assert np.abs(refine_disparity(step, np.ones((6, 8)), gradient, image) - step).max() > 3


def test_a_halo_is_pulled_to_the_edge_of_the_image():
    frame = toy_frame(0)
    refined = refine_disparity(frame.disparity, frame.confidence, frame.gradient, frame.image)
    halo = (np.abs(frame.disparity - frame.truth) > 5) & np.isfinite(frame.truth)
    assert halo.sum() > 100
    before, after = (np.abs(d - frame.truth)[halo].mean() for d in (frame.disparity, refined))
    assert after < 0.1 * before


def test_a_solver_that_stalls_says_so_and_falls_back(monkeypatch):
    import refine.solvers.cg

    monkeypatch.setattr(refine.solvers.cg, "MAX_ITERATIONS", 3)
    problem = random_problem(20, 20, seed=11)
    with pytest.warns(ConvergenceWarning, match=r"the cg solver stopped .* after 3 iterations"):
        solution = solve_mrf(*problem.inputs, solver="cg")
    assert solution.info.fell_back
    assert solution.info.solver == "direct"
    np.testing.assert_array_equal(solution.disparity, solve_mrf(*problem.inputs, solver="direct").disparity)


def test_a_region_tied_to_nothing_is_an_error_not_a_number():
    parameters = MRFParameters(alpha=0.0, beta=0.0, confidence_floor=0.0)
    confidence = np.ones((5, 5))
    confidence[2, 2] = 0
    problem = random_problem(5, 5, seed=12)
    for solver in ("direct", "cg", "multigrid"):
        with pytest.raises(SolverError, match="5x5"):
            solve_mrf(
                problem.disparity,
                confidence,
                problem.gradient,
                problem.image,
                parameters,
                solver=solver,
            )


def change(problem: Problem, **arrays: object) -> tuple[object, ...]:
    values = {**vars(problem), **arrays}
    return values["disparity"], values["confidence"], values["gradient"], values["image"]


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"disparity": np.zeros(5)}, r"disparity must be \(H, W\)"),
        ({"disparity": np.zeros((0, 4))}, "at least one pixel"),
        ({"disparity": np.full((4, 5), np.inf)}, "infinities"),
        ({"disparity": np.full((4, 5), np.nan)}, "none of the 5x4 pixels"),
        ({"confidence": np.ones((5, 4))}, r"confidence has shape \(5, 4\)"),
        ({"confidence": np.full((4, 5), 1.5)}, r"confidence must be in \[0, 1\].*1\.5"),
        ({"confidence": np.full((4, 5), np.nan)}, "20 NaN"),
        ({"gradient": np.zeros((4, 5))}, r"expected \(4, 5, 2\)"),
        ({"gradient": np.full((4, 5, 2), -np.inf)}, "gradient holds infinities"),
        ({"image": np.zeros((4, 5, 3))}, "must be uint8.*float64"),
        ({"image": np.zeros((4, 5), np.uint8)}, r"\(4, 5, 3\)"),
    ],
)
def test_bad_arrays_are_named(arrays, message):
    with pytest.raises(ValueError, match=message):
        refine_disparity(*change(random_problem(4, 5, seed=0), **arrays))


@pytest.mark.parametrize(
    ("options", "message"),
    [({"form": "best"}, "'best'"), ({"solver": "magic"}, "'magic'"), ({"tolerance": 0.0}, "tolerance")],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        refine_disparity(*random_problem(4, 5, seed=0).inputs, **options)


@pytest.mark.parametrize(
    "values", [{"alpha": -1.0}, {"beta": float("nan")}, {"sigma_r": 0.0}, {"confidence_floor": 2.0}]
)
def test_bad_parameters_are_named(values):
    with pytest.raises(ValueError, match=next(iter(values))):
        MRFParameters(**values)


def test_no_warning_in_the_usual_case():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refine_disparity(*random_problem(70, 70, seed=13).inputs)


@pytest.mark.parametrize("step", [(21, 21, 21), (10, 10, 34), (8, 15, 33), (4, 11, 35), (0, 22, 30)])
def test_couplings_next_to_nothing_do_not_stop_the_multigrid(step):
    """Pixels at the ends of bars, tied to them by 1e-43 to 1e-45 (without the colour term) and to nothing else."""
    problem = random_problem(70, 90, seed=6)
    bars = np.zeros((70, 90, 3), np.uint8)
    bars[::3, 10:80] = 150
    bars[::3, 80] = 150 + np.array(step)
    inputs = (problem.disparity, 0.2 * problem.confidence, problem.gradient, bars)
    parameters = MRFParameters(beta=0.0)
    solution = solve_mrf(*inputs, parameters, solver="multigrid")
    assert not solution.info.fell_back
    direct = solve_mrf(*inputs, parameters, solver="direct")
    np.testing.assert_allclose(solution.disparity, direct.disparity, rtol=0, atol=1e-3)


def test_the_colour_term_alone_takes_long_but_converges():
    problem = random_problem(90, 120, seed=0)
    inputs = (problem.disparity, problem.confidence**8, np.zeros((90, 120, 2)), problem.image)
    parameters = MRFParameters(alpha=0.0, beta=1e4, sigma_r=0.1, confidence_floor=1e-4)
    solution = solve_mrf(*inputs, parameters, solver="multigrid", tolerance=1e-4)
    assert not solution.info.fell_back
    assert solution.info.iterations > 200


def test_neighbours_are_the_eight_around():
    assert set(NEIGHBORS) == {(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)} - {(0, 0)}


def test_the_examples_in_the_docstrings_run():
    failed, tried = doctest.testmod(sys.modules[refine_disparity.__module__])
    assert tried > 10
    assert not failed
