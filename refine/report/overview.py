"""One picture of one refinement: its inputs and its result."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from stereoforge_kit.viewing import Picture, confidence_picture, disparity_picture
from stereoforge_kit.viewing.plots import STYLE, pixels

CELL_WIDTH_IN = 4.6
"""Width of each picture."""
NARROWEST = 8
"""Pictures whose sides differ by a larger factor are stretched to it."""


def overview_picture(
    image: NDArray[np.uint8],
    initial: ArrayLike,
    confidence: ArrayLike,
    refined: ArrayLike,
    deviation: ArrayLike | None = None,
) -> Picture:
    """Image, initial disparity, confidence, refined disparity and, if given, its deviation, labelled, with scales.

    Both disparities have one scale, whose end is the 99.5th percentile of the refined one, so that a few wild
    pixels do not darken everything else.

    Args:
        image: (H, W, 3) uint8, the left view.
        initial: (H, W) pixels, NaN where there is none.
        confidence: (H, W) in [0, 1].
        refined: (H, W) pixels.
        deviation: (H, W) pixels, the refined disparity's standard deviation; its scale ends at its 99.5th percentile.

    Returns:
        (H', W', 3) uint8.
    """
    refined_values = np.asarray(refined, dtype=np.float64)
    maximum = max(float(np.nanpercentile(refined_values, 99.5)), 1.0)
    cells: list[tuple[str, Picture, tuple[str, float] | None]] = [
        ("Left image", image, None),
        ("Initial disparity, px", disparity_picture(initial, maximum), ("magma", maximum)),
        ("Confidence", confidence_picture(confidence), ("viridis", 1.0)),
        ("Refined disparity, px", disparity_picture(refined_values, maximum), ("magma", maximum)),
    ]
    if deviation is not None:
        widest = max(float(np.nanpercentile(np.asarray(deviation), 99.5)), 1e-6)
        cells.append(("Standard deviation, px", disparity_picture(deviation, widest), ("magma", widest)))
    rows = -(-len(cells) // 2)
    shape = image.shape[0] / image.shape[1]
    shown = min(max(shape, 1 / NARROWEST), NARROWEST)
    height_in = CELL_WIDTH_IN * shown * 0.93 + 0.3
    figure = Figure(figsize=(2 * CELL_WIDTH_IN, rows * height_in), layout="constrained")
    with rc_context(STYLE):
        for place, (title, picture, scale) in enumerate(cells, start=1):
            axes = figure.add_subplot(rows, 2, place)
            # Keeping the shape of a column of pixels would take hundreds of thousands of rows.
            axes.imshow(picture, interpolation="antialiased", aspect="equal" if shape == shown else "auto")
            axes.set_title(title, loc="left")
            axes.set_axis_off()
            # The image has no scale, but keeps the room of one, so that all pictures have one size.
            bar = axes.inset_axes((1.015, 0, 0.03, 1))
            if scale is None:
                bar.set_visible(False)
            else:
                figure.colorbar(ScalarMappable(Normalize(0, scale[1]), scale[0]), cax=bar)
    return pixels(figure)
