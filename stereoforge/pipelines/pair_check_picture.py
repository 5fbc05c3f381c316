"""A picture of the matches of a pair, coloured by their vertical offset."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from stereoforge.pipelines.pair_check import NEARLY_PX, PairCheck
from stereoforge_kit.viewing import Picture
from stereoforge_kit.viewing.pictures import LUMA
from stereoforge_kit.viewing.plots import STYLE, pixels

WIDTH_IN = 9.0
LARGEST_SHOWN = 0.98
"""Quantile of the offsets at which the scale ends."""


def check_picture(left: NDArray[np.uint8], check: PairCheck) -> Picture:
    """The left view in grey with a dot at every match: red where the right view's content lies lower, blue higher.

    Beside it the offsets over the rows. Of views that share no points, the grey view alone.

    Args:
        left: (H, W, 3) uint8.
        check: Of the pair.

    Returns:
        (H', W', 3) uint8.
    """
    points = check.matches.left
    offsets = check.matches.right[:, 1] - points[:, 1]
    scale = max(NEARLY_PX, float(np.quantile(np.abs(offsets), LARGEST_SHOWN))) if len(points) else NEARLY_PX
    shape = min(max(left.shape[0] / left.shape[1], 0.25), 2.0)
    figure = Figure(figsize=(WIDTH_IN, 0.72 * WIDTH_IN * shape + 0.75), layout="constrained")
    with rc_context(STYLE):
        view, rows = figure.subplots(1, 2, width_ratios=(4, 1))
        grey = left @ LUMA * 0.55 + 100
        view.imshow(grey, cmap="gray", vmin=0, vmax=255, aspect="auto")
        view.set_title(f"{check.verdict}: {len(points)} matches, vertical offset in px", loc="left")
        view.set_axis_off()
        colored = {"c": offsets, "cmap": "coolwarm", "vmin": -scale, "vmax": scale}
        dots = view.scatter(*points.T, s=16, edgecolors="#202020", linewidths=0.4, **colored)
        figure.colorbar(dots, ax=view, fraction=0.03, pad=0.01)
        rows.scatter(offsets, points[:, 1], s=6, **colored)
        rows.axvline(0, color="#888888", linewidth=0.8)
        rows.set_xlim(-scale, scale)
        rows.set_ylim(left.shape[0], 0)
        rows.set_xlabel("vertical offset, px")
        rows.set_ylabel("row")
    return pixels(figure)
