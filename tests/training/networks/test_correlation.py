"""The banded matrix product against the formula, position by position."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from training.networks import Correlation1D, correlate_1d


def by_the_formula(left: np.ndarray, right: np.ndarray, max_displacement: int, one_sided: bool) -> np.ndarray:
    batch, channels, height, width = left.shape
    count = max_displacement + 1 if one_sided else 2 * max_displacement + 1
    result = np.zeros((batch, count, height, width))
    for b, k, y, x in np.ndindex(batch, count, height, width):
        other = x + k - max_displacement
        if 0 <= other < width:
            result[b, k, y, x] = (
                sum(left[b, c, y, x] * right[b, c, y, other] for c in range(channels)) / channels
            )
    return result


@settings(max_examples=25, deadline=None)
@given(
    width=st.integers(1, 23),
    max_displacement=st.integers(0, 6),
    one_sided=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_equals_the_formula(width: int, max_displacement: int, one_sided: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    left, right = rng.normal(size=(2, 2, 3, 2, width))
    got = correlate_1d(torch.from_numpy(left), torch.from_numpy(right), max_displacement, one_sided)
    np.testing.assert_allclose(got, by_the_formula(left, right, max_displacement, one_sided), atol=1e-12)


@pytest.mark.parametrize("one_sided", [False, True])
def test_gradient(one_sided: bool) -> None:
    generator = torch.Generator().manual_seed(0)
    left, right = torch.randn(2, 1, 2, 2, 11, dtype=torch.float64, generator=generator).requires_grad_(True)
    assert torch.autograd.gradcheck(lambda a, b: correlate_1d(a, b, 3, one_sided), (left, right))


@pytest.mark.parametrize("one_sided", [False, True])
@pytest.mark.parametrize("disparity", [0, 1, 7, 40])
def test_a_match_answers_in_its_channel(disparity: int, one_sided: bool) -> None:
    """A point of disparity d lies d pixels further left in the right image: channel 40 - d."""
    generator = torch.Generator().manual_seed(1)
    scene = torch.randn(1, 64, 3, 160, generator=generator)
    left, right = scene[..., :100], scene[..., disparity : disparity + 100]
    best = Correlation1D(40, one_sided)(left, right).argmax(dim=1)
    assert (best[..., disparity:] == 40 - disparity).all()


def test_refuses_maps_of_different_shape() -> None:
    with pytest.raises(ValueError, match=r"\(1, 2, 3, 4\) and \(1, 2, 3, 5\)"):
        correlate_1d(torch.zeros(1, 2, 3, 4), torch.zeros(1, 2, 3, 5))
