"""`stereoforge refine`: one pair of pictures to a refined disparity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from stereoforge.bundled_weights import BUNDLED_WEIGHTS, named_weights
from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import check_max_disparity, shown
from stereoforge.inputs.images import pair_doubts, read_color_images
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, remark

if TYPE_CHECKING:
    from refine.mrf.solve import MRFSolution
    from training.prediction.predictor import Prediction

WRITTEN = (
    "disparity.pfm",
    "disparity_initial.pfm",
    "confidence.pfm",
    "deviation.pfm",
    "gradient.exr",
    "overview.png",
)
"""What is written into --out."""
POSTERIOR_SAMPLES = 32
"""For --deviation: each pixel's deviation is off by an eighth of itself."""


FEW_KNOWN = 0.1
"""A disparity from another predictor that is known at a smaller share of the pixels is taken for a mistake."""
LOW_CONFIDENCE = 0.15
"""A mean confidence below this, too: the bundled weights give 0.4 on photographs, 0.1 on two that do not belong
together."""
BEYOND_INFINITY_PX = -0.5
BEYOND_INFINITY = 0.01
"""A share of disparities below that which is worth a remark."""


@dataclass(frozen=True)
class Refine:
    """Predict disparity, confidence and gradients of a rectified pair, and refine the disparity with the MRF.

    With --disparity or --predictor sgbm the disparity comes from another predictor; the run folder's confnet_free and
    gradnet_free judge it, or, without them, consistency and texture. Writes disparity.pfm, disparity_initial.pfm,
    confidence.pfm, gradient.exr and overview.png.
    """

    left: Annotated[tyro.conf.Positional[Path], shown("LEFT")]
    """Left picture (PNG, JPEG, TIFF, ...)."""
    right: Annotated[tyro.conf.Positional[Path], shown("RIGHT")]
    """Right picture, rectified and of the same size."""
    out: Annotated[Path, shown("DIR")]
    """Folder for the results."""
    weights: Annotated[Path, shown("RUN", "the bundled weights")] = BUNDLED_WEIGHTS
    """Run folder with a regressor, a confnet and a gradnet, or with confnet_free and gradnet_free, which judge any
    predictor's disparity. paper: the bundled networks of the paper."""
    disparity: Annotated[Path | None, shown("FILE", "none")] = None
    """Disparity of the left view in pixels to refine instead of predicting one: PFM (NaN, infinite, negative or
    wider than the picture where there is none) or 16-bit PNG as KITTI has it (value / 256, 0 where there is none)."""
    disparity_right: Annotated[Path | None, shown("FILE", "matched by SGBM")] = None
    """Disparity of the right view, which tells how far to trust the left one's."""
    predictor: Literal["networks", "sgbm"] = "networks"
    """What predicts the disparity: the run folder's networks, or OpenCV's semi-global matching."""
    max_disparity: Annotated[int | None, shown("PX", "chosen for the pictures")] = None
    """Largest disparity in pixels to look for. DispNetCorr1D looks as far as it was trained to."""
    parameters: Annotated[Path | None, shown("FILE", "the run folder's, if it has one")] = None
    """The MRF's parameters, as `stereoforge tune` writes them."""
    form: Annotated[Literal["exact", "paper"] | None, shown("exact|paper", "ours, as validated")] = None
    """Refine by the paper's MRF, whose gradient term is quadratic: exact minimises its energy, paper solves its eq. 8
    as printed."""
    deviation: bool = False
    """Also write deviation.pfm, the refined disparity's standard deviation in pixels under the MRF's own Gaussian (of
    the exact form): its order, least sure last, is what it is good for. Takes 32 more solves."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Refine the pair and write every output into the folder."""
        self._check()
        run = named_weights(self.weights)
        left, right, remarks = read_color_images(self.left, self.right)
        remarks += (odd := pair_doubts(left, right))
        from stereoforge.inputs.disparity_files import read_disparity
        from stereoforge.pipelines.prediction import open_settings, predict_pair

        given = None
        if self.disparity is not None:
            size = (left.shape[0], left.shape[1])
            disparity, said = read_disparity(self.disparity, size)
            other = None
            remarks += said
            if self.disparity_right is not None:
                other, said = read_disparity(self.disparity_right, size)
                remarks += said
            given = disparity, other
        predictor: Literal["networks", "sgbm"] = "sgbm" if given is not None else self.predictor
        settings = open_settings(self.parameters, run, predictor)
        method = settings.ours
        if self.form is not None:
            method = replace(settings.ours_quadratic, form=self.form)
        prediction, notes = predict_pair(
            left, right, given, run, self.device, self.predictor, self.max_disparity
        )
        assert prediction.confidence is not None
        assert prediction.gradient is not None
        with console.status("refining; the first time after an install this compiles for a minute"):
            solution = method.solve(prediction.disparity, prediction.confidence, prediction.gradient, left)
        deviation = None
        if self.deviation:
            deviation = method.sample(
                prediction.disparity, prediction.confidence, prediction.gradient, left, POSTERIOR_SAMPLES
            )
        self._write(left, prediction, solution, deviation)
        doubts = [] if odd else _doubtful_views(left, right)
        doubts += _doubts(None if given is None else given[0], prediction.confidence)
        for note in (*remarks, *notes, *doubts, *_doubtful_result(solution.disparity)):
            remark(note)
        console.print(
            f"{self.out}: disparity {solution.disparity.min():.1f} to {solution.disparity.max():.1f} px, refined in "
            f"{solution.info.seconds:.2f} s ({solution.info.solver}); look at {self.out / 'overview.png'}",
        )

    def _check(self) -> None:
        check_max_disparity(self.max_disparity)
        if self.disparity is not None and self.predictor != "networks":
            raise UsageError("--disparity and --predictor sgbm both give the disparity; choose one")
        if self.disparity_right is not None and self.disparity is None:
            raise UsageError("--disparity-right goes with --disparity")
        for name in WRITTEN:
            keep_apart("--out", self.out / name, "LEFT", self.left)
            keep_apart("--out", self.out / name, "RIGHT", self.right)
            keep_apart("--out", self.out / name, "--disparity", self.disparity)
            keep_apart("--out", self.out / name, "--disparity-right", self.disparity_right)
        check_writable("--out", self.out)

    def _write(
        self,
        left: NDArray[np.uint8],
        prediction: Prediction,
        solution: MRFSolution,
        deviation: NDArray[np.float32] | None,
    ) -> None:
        from datagen.formats import write_gradient, write_pfm, write_png
        from datagen.ground_truth.labels import gradient_validity
        from refine.report.overview import overview_picture

        refined = solution.disparity.astype("float32")
        assert prediction.confidence is not None
        assert prediction.gradient is not None
        # A slope is predicted everywhere; only the differences inside the image exist.
        inside = gradient_validity(prediction.gradient, float("inf"))
        write_pfm(self.out / "disparity.pfm", refined)
        write_pfm(self.out / "disparity_initial.pfm", prediction.disparity)
        write_pfm(self.out / "confidence.pfm", prediction.confidence)
        if deviation is not None:
            write_pfm(self.out / "deviation.pfm", deviation)
        write_gradient(self.out / "gradient.exr", prediction.gradient, inside)
        picture = overview_picture(left, prediction.disparity, prediction.confidence, refined, deviation)
        write_png(self.out / "overview.png", picture)


def _doubts(given: NDArray[np.float32] | None, confidence: NDArray[np.float32]) -> list[str]:
    """What looks like views that are swapped, or a disparity in another unit or of the other sign."""
    doubts = []
    if given is not None:
        known = np.isfinite(given).mean()
        if known < FEW_KNOWN:
            doubts.append(
                f"only {known:.1%} of the disparity is known: is it positive, in pixels of the left view?"
            )
        if (largest := np.nanquantile(given, 0.99)) < 1:
            doubts.append(f"the disparity is hardly anywhere above {largest:.2g} px: is it in pixels?")
    if confidence.mean() < LOW_CONFIDENCE:
        doubts.append(
            f"the confidence is low nearly everywhere (mean {confidence.mean():.2f}): are the views rectified, the "
            "left one first, and the disparity in pixels?"
        )
    return doubts


def _doubtful_views(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> list[str]:
    from stereoforge_kit.matching import seem_swapped

    if not seem_swapped(left, right):
        return []
    return ["more of the pair can be matched the other way round: is the first picture the left one?"]


def _doubtful_result(disparity: NDArray[np.float64]) -> list[str]:
    share = float((disparity < BEYOND_INFINITY_PX).mean())
    if share < BEYOND_INFINITY:
        return []
    return [f"{share:.0%} of the refined disparities are negative, down to {disparity.min():.1f} px"]
