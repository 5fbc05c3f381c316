"""`stereoforge refine`: pairs of pictures to refined disparities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import (
    check_disparity_scale,
    check_max_disparity,
    parse_disparity_formats,
    shown,
)
from stereoforge.inputs.images import pair_doubts
from stereoforge.inputs.results_folder import claim_results
from stereoforge.inputs.rig_flags import KnownRig, known_rig
from stereoforge.inputs.stereo_pairs import StereoPair, StereoPairs, open_pairs
from stereoforge.inputs.videos import VideoPairs
from stereoforge.pipelines.refined_names import DISPARITY, FILES, OVERVIEW
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, progress_bar, remark

if TYPE_CHECKING:
    from stereoforge.pipelines.refiner import StereoRefiner

SIDE_BY_SIDE = "side_by_side.mp4"
"""The video in --out."""
PICTURES_PER_SECOND = 10.0
"""Speed of the video of a folder of pictures."""
POSTERIOR_SAMPLES = 32
"""For --deviation: each pixel's deviation is off by an eighth of itself."""


@dataclass(frozen=True)
class Refine:
    """Predict disparity, confidence and gradients of rectified pairs, and refine the disparity with the MRF.

    With --disparity or --predictor sgbm the disparity comes from another predictor; the run folder's confnet_free and
    gradnet_free judge it, or, without them, consistency and texture. Writes disparity.pfm, disparity_initial.pfm,
    confidence.pfm, gradient.exr and overview.png; of two folders or videos, into a folder for each pair. Run it again
    to continue where it stopped.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    left: Annotated[tyro.conf.Positional[Path], shown("LEFT")]
    """Left picture (PNG, JPEG, TIFF, ...), a folder of them, a video, or a list of pairs (.txt, .csv), a line each."""
    out: Annotated[Path, shown("DIR")]
    """Folder for the results."""
    right: Annotated[tyro.conf.Positional[Path | None], shown("RIGHT", "none, with a list")] = None
    """Right picture, rectified and of the same size, the folder of the right pictures, or the right video."""
    weights: Annotated[Path, shown("RUN", "the bundled weights")] = BUNDLED_WEIGHTS
    """Run folder with a regressor, a confnet and a gradnet, or with confnet_free and gradnet_free, which judge any
    predictor's disparity. paper: the bundled networks of the paper."""
    disparity: Annotated[Path | None, shown("FILE", "none")] = None
    """Disparity of the left view in pixels to refine instead of predicting one: .pfm, .npy, .npz, .tiff or .exr (NaN,
    infinite, negative or wider than the picture where there is none; int16 as OpenCV's matchers return it) or 16-bit
    PNG as KITTI has it (value / 256, 0 where there is none)."""
    disparity_right: Annotated[Path | None, shown("FILE", "matched by SGBM")] = None
    """Disparity of the right view, which tells how far to trust the left one's."""
    disparity_scale: Annotated[float | None, shown("S", "256 in 16-bit PNG, else 1")] = None
    """--disparity and --disparity-right: value / S is the disparity in pixels."""
    predictor: Literal["networks", "sgbm"] = "networks"
    """What predicts the disparity: the run folder's networks, or OpenCV's semi-global matching."""
    max_disparity: Annotated[int | None, shown("PX", "chosen for the pictures")] = None
    """Largest disparity in pixels to look for. DispNetCorr1D looks as far as it was trained to."""
    parameters: Annotated[Path | None, shown("FILE", "the run folder's, if it has one")] = None
    """The MRF's parameters, as `stereoforge tune` writes them."""
    also_as: Annotated[str | None, shown("LIST", "PFM only")] = None
    """Write the refined disparity in these formats too, comma-separated: exr, npy, npz, png (16 bits, value / 256, 0
    where there is none, as KITTI has it), tiff."""
    form: Annotated[Literal["exact", "paper"] | None, shown("exact|paper", "ours, as validated")] = None
    """Refine by the paper's MRF, whose gradient term is quadratic: exact minimises its energy, paper solves its eq. 8
    as printed."""
    deviation: bool = False
    """Also write deviation.pfm, the refined disparity's standard deviation in pixels under the MRF's own Gaussian (of
    the exact form): its order, least sure last, is what it is good for. Takes 32 more solves."""
    calibration: Annotated[Path | None, shown("FILE", "none")] = None
    """Calibration of the rig, by OpenCV, Middlebury, KITTI, ROS (LEFT.yaml,RIGHT.yaml) or as JSON: also write the depth
    in metres (depth.exr, depth.npy, depth.png in millimetres) and the coloured points (points.ply)."""
    focal_px: Annotated[float | None, shown("PX", "none")] = None
    """Instead of --calibration: focal length in pixels, with --baseline-m; the principal point is the middle."""
    baseline_m: Annotated[float | None, shown("M", "none")] = None
    """Distance of the two cameras in metres."""
    doffs: Annotated[float, shown("PX")] = 0.0
    """How much farther right the principal point is in the right view than in the left one."""
    min_confidence: Annotated[float, shown("C")] = 0.3
    """Pixels of a lower confidence are left out of points.ply, as are those at the edges of things."""
    video: bool = False
    """Of two folders or videos: also write side_by_side.mp4, the left views beside their disparities."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""
    precision: Literal["auto", "32", "bf16"] = "auto"
    """Bits of the networks' convolutions; auto is bf16 on processors that multiply it in hardware, else 32."""

    def run(self) -> None:
        """Refine every pair and write its results."""
        self._check()
        rig = known_rig(self.calibration, self.focal_px, self.baseline_m, self.doffs)
        pairs = open_pairs(self.left, self.right)
        single = self.right is not None and not self.left.is_dir() and not isinstance(pairs, VideoPairs)
        if not single and self.disparity is not None:
            raise UsageError("--disparity is of one pair; give two pictures")
        if single and self.video:
            raise UsageError("--video is for folders and videos; one pair has overview.png")
        from stereoforge.pipelines.refiner import StereoRefiner

        refiner = StereoRefiner(
            self.weights,
            predictor="networks" if self.disparity is None and self.predictor == "networks" else "sgbm",
            parameters=self.parameters,
            form=self.form,
            max_disparity=self.max_disparity,
            device=self.device,
            precision=self.precision,
        )
        for note in (pairs.note, *refiner.notes):
            if note:
                remark(note)
        if not single:
            self._refine_all(refiner, pairs, rig)
            return
        with console.status("refining; the first time after an install this compiles for a minute"):
            said = self._refine(refiner, next(iter(pairs)), rig)
        for line in said[:-1]:
            remark(line)
        console.print(said[-1], markup=False)

    def _refine_all(self, refiner: StereoRefiner, pairs: StereoPairs, rig: KnownRig | None) -> None:
        """Refine the pairs of two folders or videos but for those that are there already."""
        from stereoforge.pipelines.side_by_side import write_video

        claim_results(self.out, self._settings(refiner, rig), "--out")
        made = found = 0
        with progress_bar() as progress:
            task = progress.add_task("refining", total=len(pairs))
            for pair in pairs:
                if (self.out / pair.name / OVERVIEW).is_file():
                    found += 1
                else:
                    for line in self._refine(refiner, pair, rig)[:-1]:
                        remark(f"{pair.name}: {line}")
                    made += 1
                progress.advance(task)
            if self.video:
                task = progress.add_task(f"writing {SIDE_BY_SIDE}", total=made + found)
                speed = pairs.frames_per_second if isinstance(pairs, VideoPairs) else PICTURES_PER_SECOND
                write_video(self.out / SIDE_BY_SIDE, pairs, self.out, speed, lambda: progress.advance(task))
        console.print(f"{self.out}: {made} pairs refined, {found} were there already", markup=False)

    def _settings(self, refiner: StereoRefiner, rig: KnownRig | None) -> dict[str, Any]:
        """All that decides the results of a folder, as JSON values."""
        return {
            **refiner.settings,
            "left": str(self.left.resolve()),
            "right": None if self.right is None else str(self.right.resolve()),
            "deviation": self.deviation,
            "rig": None if rig is None else rig.as_json(),
            "min_confidence": self.min_confidence,
            "also_as": list(self._other_endings()),
        }

    def _other_endings(self) -> tuple[str, ...]:
        """Endings of the formats that the disparity is written in besides PFM."""
        return parse_disparity_formats("--also-as", self.also_as, besides=Path(DISPARITY).suffix)

    def _refine(self, refiner: StereoRefiner, pair: StereoPair, rig: KnownRig | None) -> list[str]:
        """Refine one pair, write its results, and return what is to be said of it, the result last."""
        left, right, remarks = pair.read()
        remarks += (odd := pair_doubts(left, right))
        from stereoforge.inputs.disparity_files import read_disparity
        from stereoforge.pipelines.doubts import disparity_doubts, result_doubts, view_doubts
        from stereoforge.pipelines.refined_files import write_refined

        size = (left.shape[0], left.shape[1])
        given: list[NDArray[np.float32] | None] = []
        for path in (self.disparity, self.disparity_right):
            disparity, said = (None, []) if path is None else read_disparity(path, size, self.disparity_scale)
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
        calibration = None
        if rig is not None:
            calibration, said = rig.calibration((size[1], size[0]))
            remarks += said
        remarks += write_refined(out, left, refined, calibration, self.min_confidence, self._other_endings())
        doubts = [] if odd else view_doubts(left, right)
        if given[0] is not None:
            doubts += disparity_doubts(given[0])
        doubts += result_doubts(refined)
        disparity = refined.disparity
        return [
            *remarks,
            *doubts,
            f"{out}: disparity {disparity.min():.1f} to {disparity.max():.1f} px, refined in "
            f"{refined.info.seconds:.2f} s ({refined.info.solver}); look at {out / OVERVIEW}",
        ]

    def _check(self) -> None:
        check_max_disparity(self.max_disparity)
        check_disparity_scale(self.disparity_scale, "--disparity", self.disparity)
        if self.disparity is not None and self.predictor != "networks":
            raise UsageError("--disparity and --predictor sgbm both give the disparity; choose one")
        if self.disparity_right is not None and self.disparity is None:
            raise UsageError("--disparity-right goes with --disparity")
        for flag, read in (("LEFT", self.left), ("RIGHT", self.right)):
            if read is not None and read.is_dir():
                keep_apart("--out", self.out, flag, read)
        if not 0 <= self.min_confidence <= 1:
            raise UsageError(f"--min-confidence must lie between 0 and 1, got {self.min_confidence}")
        others = [str(Path(DISPARITY).with_suffix(ending)) for ending in self._other_endings()]
        for name in (*FILES, *others, SIDE_BY_SIDE):
            keep_apart("--out", self.out / name, "LEFT", self.left)
            keep_apart("--out", self.out / name, "RIGHT", self.right)
            keep_apart("--out", self.out / name, "--disparity", self.disparity)
            keep_apart("--out", self.out / name, "--disparity-right", self.disparity_right)
            keep_apart("--out", self.out / name, "--calibration", self.calibration)
        check_writable("--out", self.out)
