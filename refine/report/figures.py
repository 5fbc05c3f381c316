"""The report's figures: panels as in the paper's Fig. 6, close-ups as in Fig. 1, curves as in Figs 4 and
5."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from refine.evaluation.evaluate import Evaluation, FrameScore, Panel
from refine.metrics import SparsificationCurve, optimal_curve
from refine.report.crop_selection import most_improved_boundary, worst_boundary
from refine.report.tables import BOUNDS, CONFIDENCE_LABELS
from stereoforge_kit.viewing import (
    Picture,
    confidence_picture,
    disparity_picture,
    enlarged,
    error_picture,
    shrunk,
    side_by_side,
    stacked,
)
from stereoforge_kit.viewing.plots import curves

Map = NDArray[np.float32]
"""(H, W)."""

PANEL_LONGEST = 960
"""Pictures of larger frames are shrunk to this, so that a report stays a few megabytes."""
CLOSE_UP_SIZE = (64, 96)
CLOSE_UP_ZOOM = 4


@dataclass(frozen=True)
class CloseUp:
    """A boundary close up, every pixel enlarged."""

    image: Picture
    initial: Picture
    refined: Picture
    truth: Picture
    place: str
    """Why here, and where that is."""


@dataclass(frozen=True)
class PanelView:
    """The pictures of one frame with their captions, ready for the page."""

    name: str
    summary: str
    pictures: tuple[tuple[Picture, str], ...]
    initial: Picture
    refined: Picture | None
    """None where nothing was refined, the judged method being the regressor itself."""
    refined_label: str
    close_up: CloseUp | None


def panel_view(evaluation: Evaluation, panel: Panel, failure: bool = False) -> PanelView:
    """Paint one kept frame: all disparities on the scale of the ground truth.

    The close-up shows what refinement does at its best, or for a `failure` at its worst.
    """
    frame, refined = panel.frame, panel.disparities[evaluation.judged]
    label = evaluation.labels[evaluation.judged]
    seen = frame.truth if np.isfinite(frame.truth).any() else refined
    maximum = max(float(np.max(seen, initial=0.0, where=np.isfinite(seen))), 1.0)
    initial_picture, refined_picture = (
        shrunk(disparity_picture(values, maximum), PANEL_LONGEST) for values in (frame.disparity, refined)
    )
    score = evaluation.frames[panel.order]
    before, after = score.initial_bad, score.methods[evaluation.judged].regions["all"].bad
    threshold = evaluation.options.bad_threshold
    pictures = [
        (shrunk(frame.image, PANEL_LONGEST), "Left image"),
        (initial_picture, f"Initial disparity, 0 to {maximum:.0f} px"),
        *_error_picture("Initial", frame.disparity, frame.truth, before, threshold),
        *_confidence_picture(frame.confidence),
    ]
    if evaluation.refines:
        pictures += [
            (refined_picture, f"Refined disparity ({label})"),
            *_error_picture("Refined", refined, frame.truth, after, threshold),
        ]
    return PanelView(
        name=frame.name,
        summary=_summary(evaluation, score),
        pictures=tuple(pictures),
        initial=initial_picture,
        refined=refined_picture if evaluation.refines else None,
        refined_label=label,
        close_up=_close_up(panel, refined, failure) if evaluation.refines else None,
    )


def _error_picture(
    which: str, disparity: Map, truth: Map, bad: float, threshold: float
) -> list[tuple[Picture, str]]:
    """A disparity's error with its caption; nothing where the frame has no ground truth."""
    if not np.isfinite(truth).any():
        return []
    picture = shrunk(error_picture(_error(disparity, truth), threshold), PANEL_LONGEST)
    return [(picture, f"{which} error: red above {threshold:g} px ({bad * 100:.1f} %)")]


def _confidence_picture(confidence: Map | None) -> list[tuple[Picture, str]]:
    if confidence is None:
        return []
    return [(shrunk(confidence_picture(confidence), PANEL_LONGEST), "Confidence: yellow sure, blue not")]


def panel_picture(view: PanelView) -> Picture:
    """A panel's pictures in one, three a row, as the paper's Fig. 6 has them: image, initial disparity, initial
    error; confidence, refined disparity, refined error. Those that the frame has not are left out."""
    pictures = [picture for picture, _ in view.pictures]
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-len(pictures) % 3)
    return stacked([side_by_side(pictures[start : start + 3]) for start in range(0, len(pictures), 3)])


def close_up_picture(close_up: CloseUp) -> Picture:
    """A close-up's pictures side by side, as the paper's Fig. 1: image, initial, refined, ground truth."""
    return side_by_side([close_up.image, close_up.initial, close_up.refined, close_up.truth])


def curve_figure(measured: Mapping[str, SparsificationCurve], bad_rate: float | None, title: str) -> Figure:
    """Sparsification curves with the random and the optimal order; the latter from `bad_rate` if not
    given."""
    shown = dict(measured)
    if bad_rate is not None and not math.isnan(bad_rate):
        shown["optimal"] = optimal_curve(bad_rate)
    if "optimal" in shown:
        optimal = shown.pop("optimal")
        flat = np.full_like(optimal.bad_rate, optimal.bad_rate[0])
        shown |= {"random": SparsificationCurve(optimal.removed, flat), "optimal": optimal}
    series = {
        CONFIDENCE_LABELS.get(name, name): (curve.removed * 100, curve.bad_rate * 100)
        for name, curve in shown.items()
    }
    bounds = [CONFIDENCE_LABELS[name] for name in BOUNDS]
    return curves(series, "least confident pixels removed, %", "bad pixels left, %", title, bounds)


def auc_figure(frames: Sequence[FrameScore]) -> Figure:
    """Area under the sparsification curve of each frame, frames sorted by their optimal area."""
    known = sorted((f for f in frames if not math.isnan(f.optimal_auc)), key=lambda f: f.optimal_auc)
    names = dict.fromkeys(name for frame in known for name in frame.aucs)
    place = np.arange(1, len(known) + 1)
    series = {
        CONFIDENCE_LABELS.get(name, name): (place, [frame.aucs.get(name, math.nan) for frame in known])
        for name in names
    }
    bounds = [CONFIDENCE_LABELS[name] for name in BOUNDS]
    return curves(
        series, "frames, sorted by their optimal AUC", "AUC", "Every frame", bounds, marker="o", whole_x=True
    )


def _close_up(panel: Panel, refined: NDArray[np.float32], failure: bool) -> CloseUp | None:
    frame = panel.frame
    if failure:
        reason = "the depth boundary where the result is worst"
        window = worst_boundary(refined, frame.truth, CLOSE_UP_SIZE)
    else:
        reason = "the depth boundary where refinement changes most for the better"
        window = most_improved_boundary(frame.disparity, refined, frame.truth, CLOSE_UP_SIZE)
    if window is None:
        return None
    truth = frame.truth[window]
    maximum = max(float(np.nanmax(truth)) * 1.1, 1.0)
    initial_view, refined_view, truth_view = (
        enlarged(disparity_picture(values, maximum), CLOSE_UP_ZOOM)
        for values in (frame.disparity[window], refined[window], truth)
    )
    rows, columns = window
    place = f"{reason}, columns {columns.start}–{columns.stop - 1}, rows {rows.start}–{rows.stop - 1}"
    return CloseUp(
        enlarged(frame.image[window], CLOSE_UP_ZOOM), initial_view, refined_view, truth_view, place
    )


def _error(disparity: NDArray[np.float32], truth: NDArray[np.float32]) -> NDArray[np.float32]:
    """|d - d*|; an estimate that is missing counts as infinitely wrong, as it does in the bad rate."""
    error: NDArray[np.float32] = np.abs(disparity - truth)
    error[np.isfinite(truth) & ~np.isfinite(disparity)] = np.inf
    return error


def _summary(evaluation: Evaluation, score: FrameScore) -> str:
    """The errors before and after."""
    if not score.has_truth:
        return "No ground truth, so no errors"
    names = [name for name in dict.fromkeys(("regressor", evaluation.judged)) if name in score.methods]
    regions = {evaluation.labels[name]: score.methods[name].regions["all"] for name in names}
    return "; ".join(
        f"{label}: {region.bad * 100:.1f} % bad, EPE {region.epe:.2f} px" for label, region in regions.items()
    )
