"""The torch refinement: the same answer as the reference, and gradients against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from refine import MRFParameters, SolverError, solve_mrf
from refine.energy.affinity import edge_weights, neighbor_weights
from refine.mrf.torch.differentiable import ImageWeights, image_weights, refine_batch
from tests.refine.worlds import Problem, random_problem

FORMS = ["exact", "paper"]
TIGHT = 1e-12


@pytest.fixture(params=["kernels", "torch"])
def solver(request, monkeypatch):
    """The exact form as on CPUs, and as on other devices."""
    if request.param == "torch":
        monkeypatch.setattr("refine.mrf.torch.differentiable._has_kernels", lambda *_: False)


def batch(problems: list[Problem]) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    disparity, confidence, gradient, image = (
        torch.from_numpy(np.stack([inputs[i] for inputs in (problem.inputs for problem in problems)]))
        for i in range(4)
    )
    return disparity, confidence, gradient.permute(0, 3, 1, 2), image.permute(0, 3, 1, 2)


@pytest.mark.parametrize("style", ["noise", "smooth", "constant", "mixed"])
@pytest.mark.parametrize("size", [(9, 11), (1, 5), (4, 1)])
def test_image_weights_are_those_of_the_reference(style, size):
    problem = random_problem(*size, seed=1, style=style)
    weights = image_weights(batch([problem])[3], 2.55, torch.float64)
    phi_x, phi_y = edge_weights(problem.image, 2.55)
    np.testing.assert_allclose(weights.phi_x[0], phi_x, rtol=1e-10)
    np.testing.assert_allclose(weights.phi_y[0], phi_y, rtol=1e-10)
    np.testing.assert_allclose(weights.neighbors[0], neighbor_weights(problem.image), atol=1e-9)


@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize("form", FORMS)
def test_a_batch_is_solved_like_its_samples(form):
    problems = [random_problem(12, 9, seed, style) for seed, style in enumerate(["mixed", "smooth", "noise"])]
    problems[1].gradient[3, 4, 0] = np.nan
    disparity, confidence, gradient, image = batch(problems)
    weights = image_weights(image, 2.55, torch.float64)
    found = refine_batch(disparity, confidence, gradient, weights, form=form, tolerance=TIGHT)
    for problem, refined in zip(problems, found, strict=True):
        expected = solve_mrf(*problem.inputs, form=form, solver="direct").disparity
        np.testing.assert_allclose(refined, expected, rtol=0, atol=1e-6)


@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize("form", FORMS)
def test_every_entry_of_every_jacobian_agrees_with_finite_differences(form):
    """What torch's gradcheck compares in its full mode and with its tolerances, every perturbed problem a sample of one
    batch: two solves an input instead of over a thousand."""
    disparity, confidence, gradient, image = batch([random_problem(7, 6, seed=3, style="smooth")])
    weights = image_weights(image, 2.55, torch.float64)
    confidence = 0.1 + 0.8 * confidence  # away from the floor, where there is a kink
    inputs = (disparity, confidence, gradient, weights.phi_x, weights.phi_y, weights.neighbors)

    def solved(d, c, g, phi_x, phi_y, w):
        return refine_batch(d, c, g, ImageWeights(phi_x, phi_y, w), form=form, tolerance=TIGHT)

    pixels = disparity.numel()
    copies = [each.repeat(pixels, *[1] * (each.ndim - 1)).requires_grad_() for each in inputs]
    solved(*copies).flatten(1).diagonal().sum().backward()  # of sample p the loss is its pixel p
    for number, (each, copy) in enumerate(zip(inputs, copies, strict=True)):
        steps = 1e-5 * torch.eye(each.numel(), dtype=torch.float64).view(-1, *each.shape[1:])
        moved = [other.expand(2 * each.numel(), *other.shape[1:]) for other in inputs]
        moved[number] = torch.cat([each + steps, each - steps])
        above, below = solved(*moved).flatten(1).chunk(2)
        numeric = (above - below).T / 2e-5  # (pixels, elements)
        assert copy.grad is not None
        torch.testing.assert_close(copy.grad.flatten(1), numeric, rtol=1e-4, atol=1e-4)


@pytest.mark.usefixtures("solver")
def test_gradcheck():
    """torch's own check, of random directions."""
    disparity, confidence, gradient, image = batch([random_problem(7, 6, seed=3, style="smooth")])
    weights = image_weights(image, 2.55, torch.float64)
    inputs = [each.clone().requires_grad_() for each in (disparity, 0.1 + 0.8 * confidence, gradient)]

    def solved(d, c, g):
        return refine_batch(d, c, g, weights, tolerance=TIGHT)

    assert torch.autograd.gradcheck(solved, inputs, eps=1e-5, atol=1e-4, rtol=1e-4, fast_mode=True)


@pytest.mark.usefixtures("solver")
def test_whole_frames_in_single_precision():
    """Couplings thousands of times tau, disparities of tens of pixels: the residual of float32 vectors stalls there."""
    problem = random_problem(90, 130, seed=6, style="smooth")
    problem.confidence[:, 40:] *= 1e-3
    disparity, confidence, gradient, image = (each.float() for each in batch([problem]))
    found = refine_batch(disparity, confidence, gradient, image_weights(image, 2.55), tolerance=1e-7)
    expected = solve_mrf(*problem.inputs, solver="direct").disparity
    assert found.dtype == torch.float32
    np.testing.assert_allclose(found[0], expected, atol=0.01)


def test_descending_the_gradients_finds_a_confidence_that_helps():
    y, x = np.mgrid[:12, :14].astype(float)
    truth = torch.from_numpy(10 + 0.2 * x - 0.1 * y)[None]
    disparity = truth.clone()
    disparity[:, 4:8, 5:9] += 6
    slopes = torch.tensor([0.2, -0.1], dtype=torch.float64)[None, :, None, None].expand(1, 2, 12, 14)
    weights = image_weights(torch.full((1, 3, 12, 14), 90, dtype=torch.uint8), 2.55, torch.float64)
    score = torch.zeros_like(disparity, requires_grad=True)
    optimizer = torch.optim.Adam([score], lr=0.3)
    losses = []
    for _ in range(25):
        refined = refine_batch(disparity, score.sigmoid(), slopes, weights)
        loss = (refined - truth).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.2 * losses[0]
    wrong = (disparity - truth).abs() > 1
    assert score.sigmoid()[wrong].mean() < 0.2 < 0.6 < score.sigmoid()[~wrong].mean()


@pytest.mark.usefixtures("solver")
def test_what_does_not_converge_says_so(monkeypatch):
    for limit in (
        "mrf.torch.differentiable.MAX_ITERATIONS",
        "mrf.torch.differentiable.MAX_ROUNDS",
        "solvers.multigrid.MAX_ITERATIONS",
    ):
        monkeypatch.setattr(f"refine.{limit}", 2)
    disparity, confidence, gradient, image = batch([random_problem(20, 20, seed=4)])
    with pytest.raises(SolverError, match="short of"):
        refine_batch(disparity, confidence, gradient, image_weights(image, 2.55, torch.float64))


@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize("size", [(1, 1), (1, 7), (6, 1), (3, 2)])
def test_images_of_any_size_have_gradients(size):
    disparity, confidence, gradient, image = batch(
        [random_problem(*size, seed=8), random_problem(*size, seed=9)]
    )
    disparity.requires_grad_()
    weights = image_weights(image, 2.55, torch.float64)
    refine_batch(disparity, confidence, gradient, weights, tolerance=TIGHT).sum().backward()
    assert disparity.grad is not None
    # A 1 = tau, so the sum of a column of A^-1 T is 1 over the whole image: moving all by 1 moves the result by 1.
    torch.testing.assert_close(
        disparity.grad.flatten(1).sum(1), torch.full((2,), float(disparity[0].numel()), dtype=torch.float64)
    )


def test_bad_batches_are_named():
    disparity, confidence, gradient, image = batch([random_problem(5, 4, seed=5)])
    weights = image_weights(image, 2.55, torch.float64)
    with pytest.raises(ValueError, match=r"do not fit"):
        refine_batch(disparity, confidence, gradient.permute(0, 2, 3, 1), weights)
    disparity[0, 0, 0] = torch.nan
    with pytest.raises(ValueError, match="finite"):
        refine_batch(disparity, confidence, gradient, weights, MRFParameters())


@pytest.mark.usefixtures("solver")
def test_a_confidence_that_is_no_number_is_not_solved_for():
    disparity, confidence, gradient, image = batch([random_problem(9, 8, seed=5)])
    confidence[0, 2, 3] = torch.nan
    with pytest.raises(SolverError, match="residual of nan"):
        refine_batch(disparity, confidence, gradient, image_weights(image, 2.55, torch.float64))
