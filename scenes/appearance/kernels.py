"""Compiled kernels that nearly all textures are painted with: one pass over a picture, where numpy takes several.

Each does the arithmetic of the numpy expression it replaces, in the same order and precision, so that the bytes are
the same.
"""

from __future__ import annotations

import numpy as np

from stereoforge_kit.kernels import njit, vectorize

# Python's own numbers would raise the arithmetic to 64 bits.
_BLACK, _WHITE = np.float32(0), np.float32(255)
_HALF, _ONE, _TWO, _THREE = np.float32(0.5), np.float32(1), np.float32(2), np.float32(3)


@vectorize(["f4(f4,f4,f4)", "f8(f4,f4,f8)", "f8(f8,f8,f8)"])
def blended(below, above, cover):
    """`above` over `below`, (...) each, with an opacity `cover`."""
    return (above - below) * cover + below


@vectorize(["f4(f4)", "f8(f8)"])
def fraction(value):
    """The fractional part of (...) values, 0..1."""
    return value - np.floor(value)


@vectorize(["f4(f4,f4,f4)", "f8(f8,f4,f4)"])
def smooth_stepped(value, edge, width):
    """0 below an edge, 1 above it, with a cubic ramp of a width about it, for (...) values."""
    t = (value - edge) / width + _HALF
    t = min(max(t, _BLACK), _ONE)
    return t * t * (_THREE - _TWO * t)


@njit()
def to_bytes(picture):
    """(3, H, W) rounded to (H, W, 3) uint8."""
    _, height, width = picture.shape
    pixels = np.empty((height, width, 3), np.uint8)
    for channel in range(3):
        for row in range(height):
            for column in range(width):
                level = picture[channel, row, column] + _HALF
                pixels[row, column, channel] = np.uint8(min(max(level, _BLACK), _WHITE))
    return pixels


@njit()
def grained(picture, fine, coarse_weight, fine_weight):
    """A picture (3, H, W) as (H, W, 3) uint8, with noise from `fine` (H, W) at the scales of one and two pixels.

    The noise is in proportion to the brightness.
    """
    _, height, width = picture.shape
    lift = np.float32(12)  # A little grain in the blacks too.
    pixels = np.empty((height, width, 3), np.uint8)
    noise = np.empty(width, np.float32)
    pairs = np.empty(width, np.float32)
    for row in range(height):
        for column in range(width):
            pairs[column] = fine[row, column] + fine[row - 1, column]
        for column in range(width):
            noise[column] = (
                (pairs[column] + pairs[column - 1]) * coarse_weight + fine_weight * fine[row, column]
            ) + _ONE
        for channel in range(3):
            for column in range(width):
                level = ((picture[channel, row, column] + lift) * noise[column] - lift) + _HALF
                pixels[row, column, channel] = np.uint8(min(max(level, _BLACK), _WHITE))
    return pixels


@njit()
def nearest_of_grid(x, y, point_x, point_y, cells):
    """The nearest of a grid's points to each place, among the points of the 3 x 3 cells around it.

    `x`, `y` (H, W) are places, in cells; `point_x`, `point_y` ((cells + 2)^2,) one point in each cell of a grid with a
    margin of one cell. Returns, (H, W) each, the index of the nearest point and the squared distances to it and to the
    second nearest.
    """
    height, width = x.shape
    stride = cells + 2
    nearest = np.empty((height, width), np.int32)
    first, second = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    for row in range(height):
        for column in range(width):
            u, v = x[row, column], y[row, column]
            middle = (min(int(v), cells - 1) + 1) * stride + min(int(u), cells - 1) + 1
            best, closest, next_closest = middle, np.float32(np.inf), np.float32(np.inf)
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    index = middle + dy * stride + dx
                    across, down = point_x[index] - u, point_y[index] - v
                    squared = across * across + down * down
                    if squared < closest:
                        best, closest, next_closest = index, squared, closest
                    elif squared < next_closest:
                        next_closest = squared
            nearest[row, column], first[row, column], second[row, column] = best, closest, next_closest
    return nearest, first, second


@njit()
def stamp(top, inside, row, column, number):
    """Write a number into a periodic picture `top` (N, N) where a square mask about (row, column) is set."""
    size, side = len(top), len(inside)
    for i in range(side):
        for j in range(side):
            if inside[i, j]:
                top[(row + i - side // 2) % size, (column + j - side // 2) % size] = number
