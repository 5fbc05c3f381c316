"""Draw the figures of docs/conventions.md, one SVG for each convention.

python docs/pictures/conventions.py [OUT_FOLDER]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

BLUE, ORANGE, GREY, LIGHT = "#1f5fa8", "#c8641e", "#555555", "#d9dde3"
Point = tuple[float, float]


def arrow(axes: Axes, start: Point, end: Point, color: str = GREY, both: bool = False) -> None:
    style = {
        "arrowstyle": "<->" if both else "->",
        "color": color,
        "linewidth": 1.3,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    axes.annotate("", end, start, arrowprops=style)


def label(axes: Axes, place: Point, text: str, color: str = GREY, **options: object) -> None:
    axes.text(*place, text, color=color, fontsize=8, **{"ha": "center", "va": "center"} | options)


def pixels(axes: Axes) -> None:
    """Where pixel centres are."""
    for x in range(5):
        axes.plot([x, x], [0, 3], color=GREY, linewidth=0.8)
    for y in range(4):
        axes.plot([0, 4], [y, y], color=GREY, linewidth=0.8)
    columns, rows = np.meshgrid(np.arange(4) + 0.5, np.arange(3) + 0.5)
    axes.plot(columns.ravel(), rows.ravel(), ".", color=BLUE)
    axes.plot([2], [1.5], "+", color=ORANGE, markersize=10)
    label(axes, (2.05, 1.85), "middle (W/2, H/2)", ORANGE)
    label(axes, (0.5, 0.2), "(0.5, 0.5)", BLUE)
    label(axes, (3.5, 2.2), "(3.5, 2.5)", BLUE)
    label(axes, (2, 3.35), "blue: pixel centres; OpenCV's files have 0.5 less")
    arrow(axes, (-0.2, -0.25), (1.1, -0.25))
    label(axes, (1.3, -0.25), "x")
    arrow(axes, (-0.25, -0.2), (-0.25, 1.1))
    label(axes, (-0.25, 1.3), "y")
    axes.set_xlim(-0.6, 4.4)
    axes.set_ylim(3.6, -0.6)


def cameras(axes: Axes) -> None:
    """The axes of the world, of our cameras and of OpenCV's."""
    ahead = (0.42, 0.3)
    for x, title, down, forward, names in (
        (0.0, "world, metres", False, True, ("x", "z", "y")),
        (2.0, "camera (Blender)", False, False, ("x", "y", "z")),
        (4.0, "camera (OpenCV)", True, True, ("x", "y", "z")),
    ):
        vertical = (x, -0.7 if down else 0.7)
        third = (x + ahead[0], ahead[1]) if forward else (x - ahead[0], -ahead[1])
        for end, name in zip(((x + 0.7, 0.0), vertical, third), names, strict=True):
            arrow(axes, (x, 0.0), end, BLUE)
            label(axes, (x + 1.22 * (end[0] - x), 1.22 * end[1]), name, BLUE)
        label(axes, (x + 0.1, -1.15), title)
        if title != "world, metres":
            axes.plot([x, x + 1.1 * ahead[0]], [0, 1.1 * ahead[1]], ":", color=ORANGE, linewidth=1)
    label(axes, (3.1, 1.05), "dotted: the direction of view", ORANGE)
    axes.set_xlim(-0.6, 5.1)
    axes.set_ylim(-1.4, 1.25)


def disparity(axes: Axes) -> None:
    """Two cameras from above, and the disparity of a point."""
    left, right, point, image = (0.0, 0.0), (1.6, 0.0), (1.25, 3.0), 1.0
    for camera, name, color in ((left, "left", BLUE), (right, "right", ORANGE)):
        axes.plot([camera[0], point[0]], [camera[1], point[1]], color=color, linewidth=1)
        axes.plot([camera[0] - 0.65, camera[0] + 0.65], [image, image], color=color, linewidth=2)
        axes.plot([camera[0]] * 2, [0, image], ":", color=color, linewidth=1)
        axes.plot(*camera, "o", color=color)
        label(axes, (camera[0], -0.28), name, color)
    for camera, name, color in ((left, "$x_L - c_x$", BLUE), (right, "$x_R - c_x$", ORANGE)):
        hit = camera[0] + (point[0] - camera[0]) / 3
        arrow(axes, (camera[0], image + 0.12), (hit, image + 0.12), color)
        label(axes, (camera[0] + (-0.42 if color == BLUE else 0.42), image + 0.25), name, color)
    axes.plot(*point, "o", color="black")
    arrow(axes, left, right, both=True)
    label(axes, (0.8, 0.17), "baseline B")
    arrow(axes, (2.5, 0.0), (2.5, 3.0), both=True)
    label(axes, (2.68, 1.5), "Z")
    arrow(axes, (-0.95, 0.0), (-0.95, image), both=True)
    label(axes, (-1.15, 0.5), "$f_x$")
    label(axes, (0.75, 3.35), "$d = x_L - x_R = f_x B / Z + c_{x,L} - c_{x,R}$", "black")
    axes.set_xlim(-1.4, 2.9)
    axes.set_ylim(-0.5, 3.6)


def infinity(axes: Axes) -> None:
    """Disparity over depth, for a centred rig and for one whose principal points differ."""
    depth = np.linspace(1.0, 12.0, 200)
    for doffs, color, name in (
        (0.0, BLUE, "$c_{x,R} = c_{x,L}$"),
        (3.0, ORANGE, "$c_{x,R} > c_{x,L}$ (doffs)"),
    ):
        axes.plot(depth, 12 / depth - doffs, color=color, linewidth=1.5)
        axes.plot([1, 13.2], [-doffs, -doffs], ":", color=color, linewidth=1)
        label(axes, (9.3, 12 / 9.3 - doffs + 0.75), name, color)
        label(axes, (14.6, -doffs), "sky: 0" if doffs == 0 else "sky: -doffs", color)
    arrow(axes, (0.6, -3.8), (0.6, 12.3))
    arrow(axes, (0.6, -3.8), (13.4, -3.8))
    label(axes, (12.6, -4.7), "Z")
    label(axes, (-0.2, 11.8), "d")
    axes.set_xlim(-0.8, 16.6)
    axes.set_ylim(-5.4, 12.8)
    axes.set_aspect("auto")


def gradient(axes: Axes) -> None:
    """Forward differences of a disparity map."""
    values = np.array([[5.0, 5.5, 6.0], [5.2, 5.7, 9.0], [5.4, 5.9, 9.2]])
    for (row, column), value in np.ndenumerate(values):
        axes.add_patch(Rectangle((column, row), 1, 1, facecolor="white", edgecolor=GREY, linewidth=0.8))
        label(axes, (column + 0.5, row + 0.5), f"{value:.1f}", "black")
    arrow(axes, (0.7, 0.42), (1.3, 0.42), BLUE)
    arrow(axes, (0.42, 0.72), (0.42, 1.28), ORANGE)
    label(axes, (3.15, 0.35), "dx = 5.5 - 5.0 = 0.5", BLUE, ha="left")
    label(axes, (3.15, 0.85), "dy = 5.2 - 5.0 = 0.2", ORANGE, ha="left")
    label(axes, (3.15, 1.5), "5.7 to 9.0 is a jump:\nnot valid", GREY, ha="left")
    label(axes, (3.15, 2.35), "last column and row:\nnot valid", GREY, ha="left")
    axes.set_xlim(-0.2, 6.0)
    axes.set_ylim(3.2, -0.2)


def occlusion(axes: Axes) -> None:
    """Two cameras from above, and which points of the left view the right one sees."""
    left, right = (0.0, 0.0), (1.2, 0.0)
    axes.plot([-2.4, 3.6], [4, 4], color=GREY, linewidth=2)
    axes.plot([0.5, 1.4], [2, 2], color="black", linewidth=3)
    for camera, color in ((left, BLUE), (right, ORANGE)):
        axes.plot(*camera, "o", color=color)
        for side in (-1, 1):
            axes.plot([camera[0], camera[0] + side * 2.0], [0, 4], ":", color=color, linewidth=0.9)
    for place, text in (((-0.35, 4), "0"), ((0.75, 4), "1"), ((-1.5, 4), "2"), ((0.95, 2), "0")):
        axes.plot(*place, "o", color="white", markeredgecolor=BLUE, markersize=13)
        label(axes, place, text, BLUE)
        axes.plot([0, place[0]], [0, place[1] - 0.18], color=BLUE, linewidth=0.6)
    axes.plot([1.2, 0.75], [0, 3.85], color=ORANGE, linewidth=0.6)
    label(axes, (0.0, -0.35), "left", BLUE)
    label(axes, (1.2, -0.35), "right", ORANGE)
    label(axes, (0.6, 4.6), "labels of the left view: 0 visible, 1 occluded, 2 out of the right frame")
    axes.set_xlim(-2.8, 4.0)
    axes.set_ylim(-0.7, 4.9)


def depth(axes: Axes) -> None:
    """Depth is measured along the optical axis."""
    axes.plot(0, 0, "o", color=BLUE)
    arrow(axes, (0, 0), (0, 3.3), GREY)
    axes.plot([-0.2, 2.4], [2.5, 2.5], color=GREY, linewidth=2)
    axes.plot(1.7, 2.5, "o", color="black")
    axes.plot([0, 1.7], [0, 2.5], ":", color=ORANGE)
    arrow(axes, (2.7, 0), (2.7, 2.5), BLUE, both=True)
    label(axes, (3.3, 1.25), "depth Z", BLUE)
    label(axes, (1.2, 0.9), "distance\n(not stored)", ORANGE, ha="left")
    label(axes, (-0.1, 3.5), "optical axis")
    axes.set_xlim(-0.9, 4.0)
    axes.set_ylim(-0.4, 3.8)


def normals(axes: Axes) -> None:
    """Normals in the camera's frame, towards the camera."""
    axes.plot(0, 0, "o", color=BLUE)
    arrow(axes, (0, 0), (0.9, 0), BLUE)
    arrow(axes, (0, 0), (0, -0.7), BLUE)
    label(axes, (1.1, 0), "x", BLUE)
    label(axes, (0.0, -0.9), "z", BLUE)
    axes.add_patch(Polygon([(-0.9, 2.1), (1.3, 2.9), (1.25, 3.05), (-0.95, 2.25)], color=LIGHT))
    axes.plot([-0.9, 1.3], [2.1, 2.9], color=GREY, linewidth=2)
    arrow(axes, (0.2, 2.5), (0.2 + 0.34, 2.5 - 0.94), ORANGE)
    axes.plot([0, 0.2], [0, 2.5], ":", color=GREY, linewidth=0.9)
    label(axes, (0.75, 1.5), "n = (0.34, 0, 0.94)", ORANGE, ha="left")
    label(axes, (1.6, 3.1), "triangle, from above")
    axes.set_xlim(-1.6, 3.2)
    axes.set_ylim(-1.1, 3.4)


def flow(axes: Axes) -> None:
    """Optical flow leads from a pixel's centre to where its point is one frame later."""
    for x in range(7):
        axes.plot([x, x], [0, 3], color=LIGHT, linewidth=0.8)
    for y in range(4):
        axes.plot([0, 6], [y, y], color=LIGHT, linewidth=0.8)
    axes.plot(1.5, 0.5, ".", color=BLUE)
    axes.plot(4.8, 2.1, ".", color=ORANGE)
    arrow(axes, (1.5, 0.5), (4.8, 2.1), "black")
    label(axes, (1.4, 0.2), "frame t", BLUE)
    label(axes, (4.9, 2.4), "frame t + 1", ORANGE)
    label(axes, (3.1, -0.3), "(u, v) = (3.3, 1.6): right and down", "black")
    axes.set_xlim(-0.3, 6.3)
    axes.set_ylim(3.2, -0.6)


FIGURES: tuple[tuple[Callable[[Axes], None], Point], ...] = (
    (pixels, (3.4, 2.8)),
    (cameras, (4.6, 2.2)),
    (disparity, (3.6, 3.3)),
    (infinity, (4.2, 2.5)),
    (gradient, (4.0, 2.2)),
    (occlusion, (4.4, 3.3)),
    (depth, (3.0, 2.6)),
    (normals, (3.2, 2.8)),
    (flow, (4.0, 2.3)),
)


def main(out: Path) -> None:
    # The same SVG each time: no date, and identifiers that do not change.
    mpl.rcParams["svg.hashsalt"] = "stereoforge"
    for draw, size in FIGURES:
        figure = Figure(size, layout="constrained")
        axes = figure.add_subplot()
        axes.set_aspect("equal")
        axes.axis("off")
        draw(axes)
        figure.savefig(out / f"convention_{draw.__name__}.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
