"""What ConfNet and GradNet see beside the published inputs, against plain loops over pixels."""

import numpy as np
import torch

from training.networks.cost_features import (
    COST_CEILING,
    COST_FEATURE_CHANNELS,
    COST_OFFSETS_PX,
    LEFT_BORDER_CAP_PX,
    RESIDUAL_CEILING_PX,
    RESIDUAL_WINDOWS_PX,
    SLOPE_CHANNELS,
    SLOPE_WINDOWS_PX,
    SMOOTH_WITHIN_PX,
    cost_feature_maps,
    matching_costs,
    smooth_slopes,
)

HEIGHT, WIDTH = 7, 48


def costs_by_hand(left: np.ndarray, right: np.ndarray, disparity: np.ndarray) -> np.ndarray:
    """(9, H, W) of images (3, H, W), each row of the right view read by `np.interp`, which repeats its ends."""
    columns = np.arange(WIDTH)
    costs = np.zeros((len(COST_OFFSETS_PX), HEIGHT, WIDTH))
    for index, offset in enumerate(COST_OFFSETS_PX):
        for row in range(HEIGHT):
            for color in range(3):
                seen = np.interp(columns - disparity[row] - offset, columns, right[color, row])
                costs[index, row] += np.abs(left[color, row] - seen) / 3
    return np.minimum(costs, COST_CEILING)


def test_costs_equal_a_plain_lookup() -> None:
    rng = np.random.default_rng(0)
    left, right = rng.random((2, 3, HEIGHT, WIDTH))
    disparity = rng.uniform(-3, WIDTH + 5, (HEIGHT, WIDTH))
    got = matching_costs(
        *(torch.from_numpy(m)[None] for m in (left, right)), torch.from_numpy(disparity)[None, None]
    )
    np.testing.assert_allclose(got[0], costs_by_hand(left, right, disparity), atol=1e-9)


def test_a_right_disparity_has_its_least_cost_in_the_middle() -> None:
    """Of a textured surface shifted by 5.5 px; a disparity 2 px too small has it at the offset of 2."""
    rng = np.random.default_rng(1)
    fine = np.cumsum(rng.normal(0, 0.05, (3, HEIGHT, 2 * WIDTH + 40)), axis=2)
    left, right = fine[..., 20 : 20 + 2 * WIDTH : 2], fine[..., 31 : 31 + 2 * WIDTH : 2]
    for disparity, offset in ((5.5, 0.0), (3.5, 2.0), (6.0, -0.5)):
        constant = torch.full((1, 1, HEIGHT, WIDTH), disparity, dtype=torch.float64)
        costs = matching_costs(*(torch.from_numpy(m.copy())[None] for m in (left, right)), constant)
        inside = costs[0, :, :, 12:].mean((1, 2))
        assert COST_OFFSETS_PX[int(inside.argmin())] == offset
        assert inside.min() < 0.04  # of up to 0.11: half a pixel of interpolation


def test_the_disparity_is_compared_with_its_surroundings() -> None:
    rng = np.random.default_rng(2)
    disparity = rng.uniform(0, 30, (HEIGHT, WIDTH))
    image = torch.zeros(1, 3, HEIGHT, WIDTH, dtype=torch.float64)
    cost_features = cost_feature_maps(image, image, torch.from_numpy(disparity)[None, None])[0].numpy()
    assert cost_features.shape == (COST_FEATURE_CHANNELS, HEIGHT, WIDTH)
    across, down = cost_features[len(COST_OFFSETS_PX)], cost_features[len(COST_OFFSETS_PX) + 1]
    np.testing.assert_allclose(across[:, :-1], np.diff(disparity, axis=1).clip(-4, 4))
    np.testing.assert_allclose(down[:-1], np.diff(disparity, axis=0).clip(-4, 4))
    assert (across[:, -1] == 0).all()
    assert (down[-1] == 0).all()
    for index, window in enumerate(RESIDUAL_WINDOWS_PX):
        residual, roughness = cost_features[len(COST_OFFSETS_PX) + 2 + 2 * index :][:2]
        expected = (disparity - windowed_mean(disparity, window)).clip(
            -RESIDUAL_CEILING_PX, RESIDUAL_CEILING_PX
        )
        np.testing.assert_allclose(residual, expected, atol=1e-9)
        np.testing.assert_allclose(roughness, windowed_mean(np.abs(expected), window), atol=1e-9)
    columns = np.broadcast_to(np.arange(WIDTH), (HEIGHT, WIDTH))
    np.testing.assert_allclose(cost_features[-2], columns)
    np.testing.assert_allclose(cost_features[-1], columns - disparity)


def test_smooth_slopes_are_those_of_the_surface_beside_an_edge() -> None:
    """A slanted plane in front of another one, 7 px nearer: far from the border between them each window has one slope;
    across it, the mean of both by how much of either it holds, and nothing of the step."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    near = columns >= WIDTH // 2
    disparity = np.where(near, 17 + 0.25 * columns - 0.125 * rows, 10 - 0.5 * columns / WIDTH)
    slopes = smooth_slopes(torch.from_numpy(disparity)[None, None])[0].numpy()
    across = np.diff(disparity, axis=1, append=disparity[:, -1:])
    down = np.diff(disparity, axis=0, append=disparity[-1:])
    smooth = (np.abs(across) <= SMOOTH_WITHIN_PX) & (np.abs(down) <= SMOOTH_WITHIN_PX)
    assert not smooth[:, WIDTH // 2 - 1].any()
    for index, window in enumerate(SLOPE_WINDOWS_PX):
        for got, difference in zip(slopes[2 * index :], (across, down), strict=False):
            expected = windowed_mean(difference * smooth, window) / windowed_mean(
                smooth.astype(float), window
            )
            np.testing.assert_allclose(got, expected, atol=1e-9)


def test_slopes_are_zero_where_nothing_is_smooth() -> None:
    disparity = torch.arange(40.0).reshape(1, 1, 1, 40) * 3 + torch.zeros(1, 1, 6, 1)
    slopes = smooth_slopes(disparity)
    assert slopes.shape == (1, SLOPE_CHANNELS, 6, 40)
    assert (slopes == 0).all()


def windowed_mean(values: np.ndarray, window: int) -> np.ndarray:
    """Over as much of the window as lies inside."""
    reach = window // 2
    result = np.empty_like(values)
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            rows = slice(max(row - reach, 0), row + reach + 1)
            columns = slice(max(column - reach, 0), column + reach + 1)
            result[row, column] = values[rows, columns].mean()
    return result


def test_it_is_bounded_for_any_disparity() -> None:
    image = torch.rand(1, 3, 8, 400)
    cost_features = cost_feature_maps(image, image, torch.rand(1, 1, 8, 400) * 1e6)
    assert torch.isfinite(cost_features).all()
    assert cost_features.abs().max() <= LEFT_BORDER_CAP_PX


def test_an_image_one_pixel_wide_has_costs_too() -> None:
    left, right = torch.full((1, 3, 5, 1), 0.5), torch.full((1, 3, 5, 1), 0.4)
    got = matching_costs(left, right, torch.full((1, 1, 5, 1), 2.0))
    torch.testing.assert_close(got, torch.full((1, len(COST_OFFSETS_PX), 5, 1), 0.1))
