"""Plots in one style, as inline SVG that follows the page's light or dark ink, or as a picture.

No pyplot, hence no global figures: a plot is made, turned into text or pixels, and dropped.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from stereoforge_kit.viewing.pictures import Picture

SERIES_COLORS = ("#d1495b", "#00798c", "#edae49", "#7a5195", "#30638e", "#66a182", "#8d6a4f", "#888888")
"""Distinct on white and on black, and for the common kinds of colour blindness in their brightness."""

_INK = "#010203"
"""A colour no plot uses otherwise: SVG output replaces it by `currentColor`, the ink of the page."""

STYLE = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.titlesize": 10.0,
    "axes.titlecolor": _INK,
    "text.color": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "stereoforge",
}


def new_plot(width_in: float = 5.6, height_in: float = 3.2) -> tuple[Figure, Axes]:
    """An empty plot of a size in inches (100 pixels each on a screen at the usual zoom)."""
    with rc_context(STYLE):
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        return figure, figure.add_subplot()


def svg(figure: Figure) -> str:
    """The figure as an `<svg>` element to put inside a page: no prolog, no external reference."""
    buffer = io.StringIO()
    with rc_context(STYLE):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # In HTML an <svg> needs no namespace; without them the page holds no address that could be fetched.
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text).replace("xlink:href", "href")
    # Names of matplotlib's groups repeat from plot to plot, and nothing refers to them. Those of markers and
    # clipping paths may repeat too: the plot's own hash makes them its own.
    text = re.sub(r'<g id="[\w.]+_\d+">', "<g>", text)
    digest = hashlib.sha256(text.encode()).hexdigest()[:8]
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>p{digest}-", text)
    return text.replace(_INK, "currentColor").strip()


def svg_file(figure: Figure) -> str:
    """The figure as the text of an SVG file of its own: black on nothing."""
    buffer = io.StringIO()
    with rc_context(STYLE):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return buffer.getvalue().replace(_INK, "#000000")


def hoverable(figure: Figure) -> Markup:
    """The figure as `svg`, in an element that tells the page's script its curves, so that a pointer over it
    reads their values. Without the script, and on paper, it is the plot."""
    drawn = svg(figure)  # laid out now: the axes are where they will be
    axes = figure.axes[0]
    left, bottom, width, height = axes.get_position().bounds
    facts = {
        "box": [round(value, 5) for value in (left, 1 - bottom - height, width, height)],
        "x": [float(value) for value in axes.get_xlim()],
        "y": [float(value) for value in axes.get_ylim()],
        "x_label": axes.get_xlabel(),
        "curves": [
            {
                "name": str(line.get_label()),
                "x": _significant(line.get_xdata()),
                "y": _significant(line.get_ydata()),
            }
            for line in axes.lines
        ],
    }
    return Markup('<div class="plot" data-plot="{}">{}</div>').format(json.dumps(facts), Markup(drawn))


def _significant(values: ArrayLike) -> list[float | None]:
    """Numbers short enough for a page; null for NaN."""
    return [None if value != value else float(f"{value:.5g}") for value in np.asarray(values, np.float64)]


def pixels(figure: Figure, dots_per_inch: float = 110.0) -> Picture:
    """The figure drawn on white, (H, W, 3) uint8."""
    figure.set_dpi(dots_per_inch)
    canvas = FigureCanvasAgg(figure)
    with rc_context(STYLE):
        canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])


def curves(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]],
    x_label: str,
    y_label: str,
    title: str = "",
    references: Sequence[str] = (),
    marker: str | None = None,
    whole_x: bool = False,
) -> Figure:
    """Named curves (x, y) in one plot.

    Args:
        series: Name to the points of a curve.
        x_label, y_label, title: Texts, units included.
        references: Names of the curves that are there for comparison: thin, grey, each with dashes of its
            own.
        marker: matplotlib's code of a marker at every point, for few points.
        whole_x: Whether x counts something, so that its ticks are whole numbers.
    """
    figure, axes = new_plot()
    colors = iter(SERIES_COLORS * (1 + len(series) // len(SERIES_COLORS)))
    dashes = iter(((0, (1, 2)), (0, (5, 3)), (0, (5, 2, 1, 2))) * (1 + len(references) // 3))
    with rc_context(STYLE):
        for name, (x, y) in series.items():
            if name in references:
                axes.plot(x, y, color="#888888", linestyle=next(dashes), linewidth=1.2, label=name)
            else:
                axes.plot(x, y, color=next(colors), label=name, marker=marker, markersize=3)
        axes.xaxis.set_major_locator(MaxNLocator(nbins="auto", steps=[1, 2, 5, 10], integer=whole_x))
        _labelled(axes, x_label, y_label, title, legend=len(series) > 1)
    return figure


def histogram(
    edges: ArrayLike, shares: Mapping[str, ArrayLike], x_label: str, y_label: str, title: str = ""
) -> Figure:
    """Named histograms over common bin `edges` (N + 1), each given as N heights: outlines over areas."""
    figure, axes = new_plot()
    with rc_context(STYLE):
        for (name, heights), color in zip(shares.items(), SERIES_COLORS, strict=False):
            axes.stairs(heights, edges, color=color, label=name, linewidth=1.3)
            axes.stairs(heights, edges, color=color, fill=True, alpha=0.18)
        _labelled(axes, x_label, y_label, title, legend=len(shares) > 1)
    return figure


def _labelled(axes: Axes, x_label: str, y_label: str, title: str, legend: bool) -> None:
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.set_title(title, loc="left")
    axes.grid(True, color="#888888", alpha=0.25, linewidth=0.6)
    axes.set_ylim(bottom=0)
    if legend:
        axes.legend()
