"""`stereoforge refine`: pairs of pictures to refined disparities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import check_max_disparity, shown
from stereoforge.inputs.images import pair_doubts, read_color_images
from stereoforge.inputs.picture_pairs import PicturePair, find_pairs
from stereoforge.inputs.results_folder import claim_results
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, progress_bar, remark

if TYPE_CHECKING:
    from stereoforge.pipelines.refiner import RefinedPair, StereoRefiner

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
    """Predict disparity, confidence and gradients of rectified pairs, and refine the disparity with the MRF.

    With --disparity or --predictor sgbm the disparity comes from another predictor; the run folder's confnet_free and
    gradnet_free judge it, or, without them, consistency and texture. Writes disparity.pfm, disparity_initial.pfm,
    confidence.pfm, gradient.exr and overview.png; of two folders, into a folder for each pair. Run it again to continue
    where it stopped.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    left: Annotated[tyro.conf.Positional[Path], shown("LEFT")]
    """Left picture (PNG, JPEG, TIFF, ...), or a folder of them."""
    right: Annotated[tyro.conf.Positional[Path], shown("RIGHT")]
    """Right picture, rectified and of the same size, or the folder of the right pictures."""
    out: Annotated[Path, shown("DIR")]
    """Folder for the results."""
    weights: Annotated[Path, shown("RUN", "the bundled weights")] = BUNDLED_WEIGHTS
    """Run folder with a regressor, a confnet and a gradnet, or with confnet_free and gradnet_free, which judge any
    predictor's disparity. paper: the bundled networks of the paper."""
    disparity: Annotated[Path | None, shown("FILE", "none")] = None
    """Disparity of the left view in pixels to refine instead of predicting one: PFM or .npy, .npz
    (NaN, infinite, negative or wider than the picture where there is none; int16 as OpenCV's matchers return it) or
    16-bit PNG as KITTI has it (value / 256, 0 where there is none)."""
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
        """Refine every pair and write its results."""
        self._check()
        found = find_pairs(self.left, self.right)
        if len(found.pairs) > 1 and self.disparity is not None:
            raise UsageError("--disparity is of one pair; give two pictures")
        from stereoforge.pipelines.refiner import StereoRefiner

        refiner = StereoRefiner(
            self.weights,
            predictor="networks" if self.disparity is None and self.predictor == "networks" else "sgbm",
            parameters=self.parameters,
            form=self.form,
            max_disparity=self.max_disparity,
            device=self.device,
        )
        for note in (found.note, *refiner.notes):
            if note:
                remark(note)
        if not found.pairs[0].name:
            with console.status("refining; the first time after an install this compiles for a minute"):
                said = self._refine(refiner, found.pairs[0])
            for line in said[:-1]:
                remark(line)
            console.print(said[-1], markup=False)
            return
        self._refine_all(refiner, found.pairs)

    def _refine_all(self, refiner: StereoRefiner, pairs: tuple[PicturePair, ...]) -> None:
        """Refine the pairs of two folders but for those that are there already."""
        claim_results(self.out, {**refiner.settings, "deviation": self.deviation}, "--out")
        left = [pair for pair in pairs if not (self.out / pair.name / WRITTEN[-1]).is_file()]
        with progress_bar() as progress:
            task = progress.add_task("refining", total=len(pairs), completed=len(pairs) - len(left))
            for pair in left:
                for line in self._refine(refiner, pair)[:-1]:
                    remark(f"{pair.name}: {line}")
                progress.advance(task)
        console.print(
            f"{self.out}: {len(left)} pairs refined, {len(pairs) - len(left)} were there already",
            markup=False,
        )

    def _refine(self, refiner: StereoRefiner, pair: PicturePair) -> list[str]:
        """Refine one pair, write its results, and return what is to be said of it, the result last."""
        left, right, remarks = read_color_images(pair.left, pair.right)
        remarks += (odd := pair_doubts(left, right))
        from stereoforge.inputs.disparity_files import read_disparity

        size = (left.shape[0], left.shape[1])
        given: list[NDArray[np.float32] | None] = []
        for path in (self.disparity, self.disparity_right):
            disparity, said = (None, []) if path is None else read_disparity(path, size)
            given.append(disparity)
            remarks += said
        refined = refiner(
            left,
            right,
            disparity=given[0],
            disparity_right=given[1],
            deviation_samples=POSTERIOR_SAMPLES if self.deviation else 0,
        )
        out = self.out / pair.name
        self._write(out, left, refined)
        doubts = [] if odd else _doubtful_views(left, right)
        doubts += _doubts(given[0], refined.confidence)
        disparity = refined.disparity
        return [
            *remarks,
            *doubts,
            *_doubtful_result(disparity),
            f"{out}: disparity {disparity.min():.1f} to {disparity.max():.1f} px, refined in "
            f"{refined.info.seconds:.2f} s ({refined.info.solver}); look at {out / WRITTEN[-1]}",
        ]

    def _check(self) -> None:
        check_max_disparity(self.max_disparity)
        if self.disparity is not None and self.predictor != "networks":
            raise UsageError("--disparity and --predictor sgbm both give the disparity; choose one")
        if self.disparity_right is not None and self.disparity is None:
            raise UsageError("--disparity-right goes with --disparity")
        for flag, read in (("LEFT", self.left), ("RIGHT", self.right)):
            if read.is_dir():
                keep_apart("--out", self.out, flag, read)
        for name in WRITTEN:
            keep_apart("--out", self.out / name, "LEFT", self.left)
            keep_apart("--out", self.out / name, "RIGHT", self.right)
            keep_apart("--out", self.out / name, "--disparity", self.disparity)
            keep_apart("--out", self.out / name, "--disparity-right", self.disparity_right)
        check_writable("--out", self.out)

    def _write(self, out: Path, left: NDArray[np.uint8], refined: RefinedPair) -> None:
        from datagen.formats import write_gradient, write_pfm, write_png
        from datagen.ground_truth.labels import gradient_validity
        from refine.report.overview import overview_picture

        # A slope is predicted everywhere; only the differences inside the image exist.
        inside = gradient_validity(refined.gradient, float("inf"))
        write_pfm(out / "disparity.pfm", refined.disparity)
        write_pfm(out / "disparity_initial.pfm", refined.initial)
        write_pfm(out / "confidence.pfm", refined.confidence)
        if refined.deviation is not None:
            write_pfm(out / "deviation.pfm", refined.deviation)
        write_gradient(out / "gradient.exr", refined.gradient, inside)
        picture = overview_picture(
            left, refined.initial, refined.confidence, refined.disparity, refined.deviation
        )
        write_png(out / WRITTEN[-1], picture)


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


def _doubtful_result(disparity: NDArray[np.float32]) -> list[str]:
    share = float((disparity < BEYOND_INFINITY_PX).mean())
    if share < BEYOND_INFINITY:
        return []
    return [f"{share:.0%} of the refined disparities are negative, down to {disparity.min():.1f} px"]
