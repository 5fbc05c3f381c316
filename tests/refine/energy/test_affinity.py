"""Image weights against loops that follow the definitions word by word."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from refine.energy.affinity import NEIGHBORS, edge_weights, neighbor_weights
from tests.refine.oracles import levin_weights

images = st.tuples(st.integers(1, 6), st.integers(1, 6)).flatmap(
    lambda size: arrays(np.uint8, (*size, 3), elements=st.integers(0, 255))
)


@settings(deadline=None)
@given(images, st.sampled_from([2.55, 25.5]))
def test_edge_weights_are_the_gaussian_of_the_forward_colour_difference(image, sigma_r):
    phi_x, phi_y = edge_weights(image, sigma_r)
    height, width = image.shape[:2]
    for y in range(height):
        for x in range(width):
            here = [float(c) for c in image[y, x]]
            for phi, (ny, nx) in ((phi_x, (y, x + 1)), (phi_y, (y + 1, x))):
                inside = ny < height and nx < width
                there = [float(c) for c in image[ny, nx]] if inside else here
                squared = sum((a - b) ** 2 for a, b in zip(here, there, strict=True))
                assert phi[y, x] == pytest.approx(math.exp(-squared / (2 * sigma_r**2)), rel=1e-12)


@settings(deadline=None)
@given(images)
def test_neighbor_weights_follow_the_colourisation_code(image):
    weights = neighbor_weights(image)
    for y in range(image.shape[0]):
        for x in range(image.shape[1]):
            expected = levin_weights(image, y, x)
            for plane, place in zip(weights, NEIGHBORS, strict=True):
                assert plane[y, x] == pytest.approx(expected.get(place, 0.0), rel=1e-9, abs=1e-12)


def test_neighbor_weights_of_a_flat_image_are_equal():
    weights = neighbor_weights(np.full((3, 3, 3), 77, np.uint8))
    np.testing.assert_allclose(weights[:, 1, 1], 1 / 8)
    np.testing.assert_allclose(weights[:, 0, 0].sum(), 1)


def test_an_isolated_pixel_keeps_its_most_similar_neighbour():
    image = np.zeros((5, 5, 3), np.uint8)
    image[2, 2] = 255
    weights = neighbor_weights(image)[:, 2, 2]
    np.testing.assert_allclose(weights, 1 / 8)


def test_weights_prefer_the_neighbours_of_the_same_colour():
    image = np.zeros((3, 4, 3), np.uint8)
    image[:, 2:] = 200
    weights = dict(zip(NEIGHBORS, neighbor_weights(image)[:, 1, 1], strict=True))
    assert weights[0, -1] > 100 * weights[0, 1]
