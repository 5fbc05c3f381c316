"""The cost volume, its read-out and learnt upsampling, against loops that follow their definitions."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from training.networks.cost_volume import (
    convex_upsample,
    cosine_volume,
    normalized_groups,
    read_out,
    windowed_cosines,
)


def descriptors(seed: int, width: int, groups: int = 2) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    left, right = torch.randn(2, 2, 4 * groups, 3, width, generator=generator)
    return normalized_groups(left, groups), normalized_groups(right, groups)


def cosine(left: torch.Tensor, right: torch.Tensor, b: int, g: int, y: int, x: int, match: int) -> float:
    inside = 0 <= match < right.shape[-1]
    return float((left[b, g, :, y, x] * right[b, g, :, y, match]).sum()) if inside else 0.0


def test_groups_have_length_one() -> None:
    left, _ = descriptors(0, 7)
    torch.testing.assert_close(left.norm(dim=2), torch.ones(2, 2, 3, 7))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 99), width=st.integers(1, 12), levels=st.integers(1, 15))
def test_the_volume_holds_every_pair_of_pixels(seed: int, width: int, levels: int) -> None:
    left, right = descriptors(seed, width)
    volume = cosine_volume(left, right, levels)
    assert volume.shape == (2, 2, 3, width, levels)
    for b, g, y, x, d in np.ndindex(*volume.shape):
        assert float(volume[b, g, y, x, d]) == pytest.approx(cosine(left, right, b, g, y, x, x - d), abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 99), width=st.integers(1, 12), reach=st.integers(0, 3))
def test_a_window_of_cosines_is_interpolated_along_the_row(seed: int, width: int, reach: int) -> None:
    left, right = descriptors(seed, width)
    disparity = torch.rand(2, 1, 3, width, generator=torch.Generator().manual_seed(seed)) * 16 - 2
    window = windowed_cosines(left, right, disparity, reach).view(2, 2, 2 * reach + 1, 3, width)
    for b, g, k, y, x in np.ndindex(*window.shape):
        place = x - float(disparity[b, 0, y, x]) - (k - reach)
        before = math.floor(place)
        share = place - before
        expected = (1 - share) * cosine(left, right, b, g, y, x, before)
        expected += share * cosine(left, right, b, g, y, x, before + 1)
        assert float(window[b, g, k, y, x]) == pytest.approx(expected, abs=1e-5)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 99), levels=st.integers(2, 9), reach=st.integers(0, 3))
def test_the_read_out_is_the_expectation_around_the_best_level(seed: int, levels: int, reach: int) -> None:
    scores = 3 * torch.randn(2, 3, 4, levels, generator=torch.Generator().manual_seed(seed))
    disparity, certainty = read_out(scores, reach)
    for b, y, x in np.ndindex(2, 3, 4):
        row = scores[b, y, x].double().numpy()
        best = int(row.argmax())
        window = np.arange(max(best - reach, 0), min(best + reach, levels - 1) + 1)
        weights = np.exp(row[window] - row[best])
        assert float(disparity[b, 0, y, x]) == pytest.approx(
            (weights * window).sum() / weights.sum(), abs=1e-5
        )
        probability = np.exp(row - row.max())
        probability /= probability.sum()
        elsewhere = np.delete(probability, window).max(initial=0.0)
        entropy = -(probability * np.log(probability)).sum() / np.log(levels)
        expected = [probability[window].sum(), elsewhere, entropy]
        np.testing.assert_allclose(certainty[b, :, y, x].numpy(), expected, atol=1e-5)


def test_upsampling_mixes_the_neighbours_of_the_coarse_pixel() -> None:
    generator = torch.Generator().manual_seed(0)
    coarse, weights = (
        torch.rand(1, 1, 3, 4, generator=generator),
        torch.randn(1, 36, 3, 4, generator=generator),
    )
    fine = convex_upsample(coarse, weights, 2)
    shares = weights.view(9, 4, 3, 4).double().softmax(0)
    for y, x in np.ndindex(6, 8):
        cy, cx, part = y // 2, x // 2, 2 * (y % 2) + x % 2
        expected = sum(
            float(shares[3 * i + j, part, cy, cx])
            * float(coarse[0, 0, min(max(cy + i - 1, 0), 2), min(max(cx + j - 1, 0), 3)])
            for i in range(3)
            for j in range(3)
        )
        assert float(fine[0, 0, y, x]) == pytest.approx(expected, abs=1e-6)
