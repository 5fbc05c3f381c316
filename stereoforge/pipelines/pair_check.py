"""What can be told about a pair of pictures from the points that both show: rows, order, exposure, disparities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from stereoforge.errors import CommandError
from stereoforge_kit.matching.features import Matches, match_features
from stereoforge_kit.matching.row_alignment import RowAlignment, align_rows
from stereoforge_kit.matching.view_differences import ViewDifference, compare_views

if TYPE_CHECKING:
    from datagen.cameras.calibration import Calibration

Verdict = Literal["rectified", "nearly rectified", "not rectified", "the same picture", "unrelated"]
Order = Literal["left first", "swapped", "unclear"]

RECTIFIED_PX = 0.25
NEARLY_PX = 1.0
"""Largest vertical offsets, in the median and in any part of the picture, of the verdicts so called."""
WORTH_CORRECTING_PX = 0.1
"""A shift, or what a roll or a scale comes to at the border, that is named among the corrections."""
FEWEST_FEATURES = 30
"""Fewer in a view say nothing."""
ONE_ORDER = 0.8
"""A share of disparities of one sign that says which view is which."""
NO_PARALLAX_PX = 0.25
"""Disparities and offsets below this, of nearly all matches, are one view's."""
EXTREMES = (0.005, 0.995)
"""Quantiles that stand for the smallest and the largest disparity: a few matches are always wrong."""
MARGIN = 1.5
"""What is nearest may have no feature."""
SEARCH_STEP_PX = 16
DIFFERENT = 0.05
"""A ratio of brightness or colour further from 1 than this is worth a remark."""


@dataclass(frozen=True)
class PairCheck:
    """What was found. Numbers are None where the views share no points."""

    verdict: Verdict
    size: tuple[int, int]
    """(width, height) in px."""
    features: tuple[int, int]
    """Of the left and the right view."""
    matches: Matches
    """Those that agree with one another."""
    matched: int
    """All of them."""
    rows: RowAlignment | None = None
    difference: ViewDifference | None = None
    calibration: Calibration | None = None
    """Of the pair at its size, if it was given."""

    @property
    def disparities(self) -> NDArray[np.float64]:
        """(N,) x_left - x_right of the matches, px."""
        found: NDArray[np.float64] = self.matches.left[:, 0] - self.matches.right[:, 0]
        return found

    @property
    def disparity_range(self) -> tuple[float, float] | None:
        """The smallest and the largest disparity, px."""
        if self.rows is None:
            return None
        low, high = np.quantile(self.disparities, EXTREMES)
        return float(low), float(high)

    @property
    def positive_share(self) -> float | None:
        """Of the matches whose disparity is positive, counted from the calibration's disparity at infinity."""
        if self.rows is None:
            return None
        infinity = 0.0 if self.calibration is None else -self.calibration.doffs
        return float((self.disparities > infinity).mean())

    @property
    def order(self) -> Order:
        """Which way round the views are."""
        share = self.positive_share
        if share is None or 1 - ONE_ORDER < share < ONE_ORDER:
            return "unclear"
        return "left first" if share >= ONE_ORDER else "swapped"

    @property
    def max_disparity(self) -> int | None:
        """A --max-disparity that leaves room for what has no features; None for views that are not left first."""
        if self.disparity_range is None or self.order != "left first":
            return None
        steps = math.ceil(MARGIN * max(self.disparity_range[1], 1.0) / SEARCH_STEP_PX)
        return steps * SEARCH_STEP_PX

    @property
    def depth_range_m(self) -> tuple[float, float] | None:
        """The nearest and the farthest point by the calibration, metres; the farthest may be infinite."""
        if self.calibration is None or self.disparity_range is None or self.order != "left first":
            return None
        far, near = (
            self.calibration.fx * self.calibration.baseline_m / beyond if beyond > 0 else math.inf
            for beyond in (disparity + self.calibration.doffs for disparity in self.disparity_range)
        )
        return near, far

    @property
    def off_px(self) -> float | None:
        """How far rows are off: the median, or the worst part of the picture."""
        return None if self.rows is None else max(abs(self.rows.median_px), self.rows.worst_px)

    def as_json(self) -> dict[str, Any]:
        """All figures as JSON values."""
        rows, difference = self.rows, self.difference
        return {
            "verdict": self.verdict,
            "size": list(self.size),
            "features": list(self.features),
            "matches": self.matched,
            "consistent_matches": len(self.matches),
            "vertical_offset": None
            if rows is None
            else {
                "median_px": rows.median_px,
                "spread_px": rows.spread_px,
                "worst_part_px": rows.worst_px,
                "shift_px": rows.shift_px,
                "roll_deg": math.degrees(rows.roll_rad),
                "scale_percent": 100 * rows.scale,
                "parts": [
                    dict(zip(("x", "y", "median_px", "error_px"), part, strict=True)) for part in rows.parts
                ],
            },
            "order": self.order,
            "positive_share": self.positive_share,
            "disparity_range_px": self.disparity_range,
            "max_disparity": self.max_disparity,
            # JSON has no infinity.
            "depth_range_m": None
            if self.depth_range_m is None
            else [depth if math.isfinite(depth) else None for depth in self.depth_range_m],
            "exposure": None
            if difference is None
            else {
                "pixel_values_percent": 100 * (difference.pixel_values - 1),
                "light_percent": 100 * (difference.light - 1),
                "color_percent": [100 * (ratio - 1) for ratio in difference.channels],
            },
        }


def check_pair(
    left: NDArray[np.uint8], right: NDArray[np.uint8], calibration: Calibration | None = None
) -> PairCheck:
    """Look at a pair.

    Args:
        left, right: (H, W, 3) uint8 of one size.
        calibration: Of the rectified pair, if known; scaled to the pictures' size.

    Raises:
        CommandError: Where nothing can be said: too few features, or pictures of two sizes.
        ValueError: For a calibration of pictures of another shape.
    """
    size = (left.shape[1], left.shape[0])
    if left.shape != right.shape:
        raise CommandError(
            f"the pictures differ in size: left {size[0]}x{size[1]}, right {right.shape[1]}x{right.shape[0]}; a "
            "rectified pair does not"
        )
    scaled = None if calibration is None else calibration.scaled_to(size)
    if np.array_equal(left, right):
        nothing = Matches(np.zeros((0, 2)), np.zeros((0, 2)), (0, 0))
        return PairCheck("the same picture", size, (0, 0), nothing, 0)
    found = match_features(left, right)
    if min(found.features) < FEWEST_FEATURES:
        raise CommandError(
            f"nothing can be said: the left picture has {found.features[0]} features and the right one "
            f"{found.features[1]}, and {FEWEST_FEATURES} are needed"
        )
    rows = align_rows(found, size)
    if rows is None:
        return PairCheck("unrelated", size, found.features, found[np.zeros(len(found), bool)], len(found))
    matches = found[rows.inliers]
    return PairCheck(
        _verdict(matches, rows),
        size,
        found.features,
        matches,
        len(found),
        rows,
        compare_views(left, right, matches),
        scaled,
    )


def _verdict(matches: Matches, rows: RowAlignment) -> Verdict:
    if np.quantile(np.abs(matches.left - matches.right), 0.95) < NO_PARALLAX_PX:
        return "the same picture"
    off = max(abs(rows.median_px), rows.worst_px)
    if off <= RECTIFIED_PX:
        return "rectified"
    return "nearly rectified" if off <= NEARLY_PX else "not rectified"


def corrections(check: PairCheck) -> list[str]:
    """What would bring the right picture's rows to the left one's, in words."""
    rows = check.rows
    if rows is None or check.verdict not in ("nearly rectified", "not rectified"):
        return []
    width, height = check.size
    found = []
    if abs(rows.shift_px) >= WORTH_CORRECTING_PX:
        found.append(f"move it {'up' if rows.shift_px > 0 else 'down'} by {abs(rows.shift_px):.2f} px")
    if abs(rows.roll_rad) * width / 2 >= WORTH_CORRECTING_PX:
        turn = "counter-clockwise" if rows.roll_rad > 0 else "clockwise"
        found.append(f"turn it {turn} by {abs(math.degrees(rows.roll_rad)):.3f}°")
    if abs(rows.scale) * height / 2 >= WORTH_CORRECTING_PX:
        found.append(f"scale it to {100 / (1 + rows.scale):.2f} %")
    return found


def left_over_px(check: PairCheck) -> float:
    """The largest offset of a part of the picture that shift, roll and scale do not explain, px."""
    rows = check.rows
    if rows is None:
        return 0.0
    width, height = check.size
    shift = float(np.median(check.disparities))
    over = (
        abs(
            offset
            - rows.shift_px
            - rows.roll_rad * (x - shift - (width - 1) / 2)
            - rows.scale * (y - (height - 1) / 2)
        )
        - 2 * error
        for x, y, offset, error in rows.parts
    )
    return max(0.0, *over) if rows.parts else 0.0
