"""How far two views are from having the same rows, and which part of that is shift, roll and scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import gammaln

from stereoforge_kit.matching.features import Matches

HYPOTHESES = 1000
"""Triples of matches that are tried."""
SCORED = 1500
"""Most matches by which a hypothesis is judged."""
TOLERANCE_PX = 2.0
TOLERANCE = 0.004
"""How far from the model a match may lie, at least and as a share of the height: lenses bend rows, too."""
LARGEST_SLOPE = 0.35
"""Of roll and scale: 20 degrees, 35 %."""
BY_CHANCE = 1e-6
"""Fewer sets of matches than this agree so well by chance in pictures that show different things."""
GRID = (4, 3)
"""Parts of the picture, across and down."""
FEWEST_IN_PART = 15


@dataclass(frozen=True)
class RowAlignment:
    """The vertical offset of matching points, y_right - y_left, as a function of where they are.

    offset = shift + roll * (x - middle) + scale * (y - middle), x in the right view, y in the left one.
    """

    inliers: NDArray[np.bool_]
    """(N,) of the matches."""
    shift_px: float
    """Offset in the middle of the picture; positive where the right view's content lies lower."""
    roll_rad: float
    """By which the right view is turned; positive is clockwise."""
    scale: float
    """By which the right view is larger: 0.01 for one percent."""
    median_px: float
    """Of the offsets themselves."""
    spread_px: float
    """Of the offsets about the model: 1.4826 times the median absolute residual."""
    parts: tuple[tuple[float, float, float, float], ...]
    """Of each part of the picture with enough matches: x and y of its middle, the offsets' median and its standard
    error, px."""

    @property
    def worst_px(self) -> float:
        """The largest offset of a part of the picture that is surely there, without its sign."""
        return max(
            (max(abs(offset) - 2 * error, 0.0) for *_, offset, error in self.parts),
            default=abs(self.median_px),
        )


def align_rows(matches: Matches, size: tuple[int, int]) -> RowAlignment | None:
    """Fit the vertical offset robustly to matches of views of (width, height).

    RANSAC (Fischler and Bolles, 1981), scored as in MSAC, then a fit with a robust loss. Returns None where no model
    agrees with more matches than chance would have it (L. Moisan and B. Stival, IJCV 2004).
    """
    if len(matches) <= 3:
        return None
    middle = (np.array(size) - 1) / 2
    offsets = matches.right[:, 1] - matches.left[:, 1]
    terms = np.column_stack(
        [
            np.ones(len(matches)),
            matches.right[:, 0] - middle[0],
            matches.left[:, 1] - middle[1],
        ]
    )
    tolerance = max(TOLERANCE_PX, TOLERANCE * size[1])
    model = _ransac(terms, offsets, tolerance)
    inliers = np.abs(terms @ model - offsets) < tolerance
    if _log_false_alarms(len(matches), int(inliers.sum()), 2 * tolerance / size[1]) > np.log(BY_CHANCE):
        return None
    # Scaled, so that the solver's steps are of one size.
    units = np.array([1.0, 2 / size[0], 2 / size[1]])
    scaled = terms[inliers] * units
    fitted = least_squares(
        lambda values: scaled @ values - offsets[inliers],
        model / units,
        jac=lambda _: scaled,
        loss="soft_l1",
        f_scale=0.3,
    )
    shift, roll, scale = fitted.x * units
    residual = scaled @ fitted.x - offsets[inliers]
    return RowAlignment(
        inliers,
        float(shift),
        float(roll),
        float(scale),
        float(np.median(offsets[inliers])),
        float(1.4826 * np.median(np.abs(residual))),
        _parts(matches.left[inliers], offsets[inliers], size),
    )


def _ransac(
    terms: NDArray[np.float64], offsets: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64]:
    """The (3,) model of the best of many random triples."""
    rng = np.random.default_rng(0)
    triples = rng.integers(0, len(offsets), (HYPOTHESES, 3))
    matrices = terms[triples]
    usable = np.abs(np.linalg.det(matrices)) > 1e-3
    models = np.linalg.solve(matrices[usable], offsets[triples[usable]][..., None])[..., 0]
    models = models[(np.abs(models[:, 1:]) < LARGEST_SLOPE).all(axis=1)]
    # A pure shift is a model too, and the only one for matches in a line.
    models = np.vstack([models, [[np.median(offsets), 0.0, 0.0]]])
    scored = rng.permutation(len(offsets))[:SCORED]
    errors = np.abs(models @ terms[scored].T - offsets[scored])
    best: NDArray[np.float64] = models[np.minimum(errors / tolerance, 1).sum(axis=1).argmin()]
    return best


def _log_false_alarms(matches: int, inliers: int, chance: float) -> float:
    """Logarithm of the expected number of models of three that so many of random matches agree with."""
    if inliers <= 3:
        return 0.0
    return float(
        np.log(matches - 3)
        + _log_choose(matches, inliers)
        + _log_choose(inliers, 3)
        + (inliers - 3) * np.log(min(chance, 1.0))
    )


def _log_choose(whole: int, part: int) -> float:
    return float(gammaln(whole + 1) - gammaln(part + 1) - gammaln(whole - part + 1))


def _parts(
    points: NDArray[np.float64], offsets: NDArray[np.float64], size: tuple[int, int]
) -> tuple[tuple[float, float, float, float], ...]:
    cells = np.floor((points + 0.5) / np.array(size) * np.array(GRID)).astype(int)
    found = []
    for row in range(GRID[1]):
        for column in range(GRID[0]):
            own = offsets[(cells == (column, row)).all(axis=1)]
            if len(own) >= FEWEST_IN_PART:
                middle = float(np.median(own))
                # Of a median: sqrt(pi / 2) times that of a mean.
                error = 1.2533 * 1.4826 * float(np.median(np.abs(own - middle))) / len(own) ** 0.5
                found.append(
                    (
                        (column + 0.5) * size[0] / GRID[0],
                        (row + 0.5) * size[1] / GRID[1],
                        middle,
                        error,
                    )
                )
    return tuple(found)
