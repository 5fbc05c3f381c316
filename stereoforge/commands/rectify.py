"""`stereoforge rectify`: pairs as the cameras took them to rectified ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import shown
from stereoforge.inputs.results_folder import claim_results
from stereoforge.inputs.stereo_pairs import StereoPair, StereoPairs, open_pairs
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, progress_bar, remark

if TYPE_CHECKING:
    from datagen.cameras.rectification import Rectification

CALIBRATION = "calibration.json"
VIEWS = ("left", "right")
"""Names in --out: of the pictures of one pair, or of the folders of many."""
WORTH_A_REMARK = 0.001
"""A share of black pixels that is worth a remark."""


@dataclass(frozen=True)
class Rectify:
    """Undistort and rectify pairs with the calibration of their cameras.

    Writes left.png, right.png and calibration.json, which refine --calibration and render --camera take; of two folders
    or videos, left/ and right/ with the names of the left pictures. Run it again to continue where it stopped.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    left: Annotated[tyro.conf.Positional[Path], shown("LEFT")]
    """Left picture (PNG, JPEG, TIFF, ...) as the camera took it, a folder of them, or a video."""
    right: Annotated[tyro.conf.Positional[Path], shown("RIGHT")]
    """Right picture of the same size, or the right folder or video."""
    calibration: Annotated[str, shown("FILE")]
    """Calibration of the raw pictures: OpenCV's YAML (one file, or intrinsics.yml,extrinsics.yml), Kalibr's
    camchain.yaml, a ZED's SNxxxxx.conf, or two camera_info files of ROS (LEFT.yaml,RIGHT.yaml)."""
    out: Annotated[Path, shown("DIR")]
    """Folder for the results."""
    alpha: Annotated[float | None, shown("SHARE", "the file's own rectification, or OpenCV's")] = None
    """How much to keep, from 0 (as much as leaves hardly a pixel black) to 1 (all that the cameras took)."""
    interpolation: Literal["linear", "cubic", "lanczos"] = "lanczos"
    """How colours between pixels are made: lanczos keeps the most detail."""

    def run(self) -> None:
        """Rectify every pair."""
        self._check()
        pairs = open_pairs(self.left, self.right)
        if pairs.note:
            remark(pairs.note)
        first = next(iter(pairs))
        rectification = self._rectification(first)
        for sentence in _doubts(rectification):
            remark(sentence)
        claim_results(self.out, self._settings(rectification, single=not first.name), "--out")
        from datagen.cameras.registry import write_calibration

        write_calibration(self.out / CALIBRATION, rectification.calibration)
        if first.name:
            done = self._rectify_all(rectification, pairs)
        else:
            self._rectify(rectification, first)
            done = "rectified"
        calibration = rectification.calibration
        console.print(
            f"{self.out}: {done}; focal length {calibration.fx:.1f} px, principal points {calibration.cx_left:.1f}, "
            f"{calibration.cy:.1f} and {calibration.cx_right:.1f}, {calibration.cy:.1f} px, baseline "
            f"{calibration.baseline_m:.4g} m; stereoforge check says how well it fits",
            markup=False,
        )

    def _check(self) -> None:
        if self.alpha is not None and not 0 <= self.alpha <= 1:
            raise UsageError(f"--alpha is from 0 to 1, not {self.alpha:g}")
        for flag, read in (("LEFT", self.left), ("RIGHT", self.right)):
            if read.is_dir():
                keep_apart("--out", self.out, flag, read)
            for view in VIEWS:
                for written in (self.out / f"{view}.png", self.out / view):
                    keep_apart("--out", written, flag, read)
        for part in self.calibration.split(","):
            keep_apart("--out", self.out / CALIBRATION, "--calibration", part)
        check_writable("--out", self.out)

    def _rectification(self, first: StereoPair) -> Rectification:
        """How the pairs are rectified, all of which have the first one's size."""
        left, right, remarks = first.read()
        for sentence in remarks:
            remark(sentence)
        size = (left.shape[1], left.shape[0])
        if left.shape != right.shape:
            raise CommandError(
                f"the pictures differ in size: left {size[0]}x{size[1]}, right {right.shape[1]}x{right.shape[0]}"
            )
        from datagen.cameras.rectification import plan_rectification
        from datagen.cameras.registry import read_raw_calibration

        raw = read_raw_calibration(self.calibration, size)
        try:
            return plan_rectification(raw, self.alpha)
        except ValueError as error:
            raise CommandError(f"{self.calibration}: {error}") from error

    def _settings(self, rectification: Rectification, single: bool) -> dict[str, Any]:
        """All that decides the rectified pictures; a calibration by its numbers, whatever file it came from."""
        raw = rectification.raw
        views = {
            name: {"matrix": view.matrix.tolist(), "lens": [view.model, *view.distortion.tolist()]}
            for name, view in zip(VIEWS, (raw.left, raw.right), strict=True)
        }
        return {
            "left": None if single else str(self.left.resolve()),
            "right": None if single else str(self.right.resolve()),
            "calibration": {
                **views,
                "rectifying_rotations": [rotation.tolist() for rotation in rectification.rotations],
                "projections": [projection.tolist() for projection in rectification.projections],
                "size": list(raw.size),
            },
            "alpha": self.alpha,
            "interpolation": self.interpolation,
        }

    def _rectify_all(self, rectification: Rectification, pairs: StereoPairs) -> str:
        """Rectify the pairs of folders or videos but for those that are there already, and say how many."""
        made = found = 0
        with progress_bar() as progress:
            task = progress.add_task("rectifying", total=len(pairs))
            for pair in pairs:
                if self._written(pair)[1].is_file():
                    found += 1
                else:
                    self._rectify(rectification, pair)
                    made += 1
                progress.advance(task)
        return f"{made} pairs rectified, {found} were there already"

    def _written(self, pair: StereoPair) -> tuple[Path, Path]:
        """The rectified pictures of a pair."""
        left, right = (
            self.out / view / f"{pair.name}.png" if pair.name else self.out / f"{view}.png" for view in VIEWS
        )
        return left, right

    def _rectify(self, rectification: Rectification, pair: StereoPair) -> None:
        """Rectify one pair and write its pictures, the right one last."""
        from datagen.formats import write_png

        left, right, _ = pair.read()
        try:
            rectified = rectification(left, right, self.interpolation)
        except ValueError as error:
            raise CommandError(f"{pair.name or self.left}: {error}") from error
        for path, picture in zip(self._written(pair), rectified, strict=True):
            write_png(path, picture)


def _doubts(rectification: Rectification) -> list[str]:
    """What is odd about the rectified pictures."""
    black = [1 - float(seen.mean()) for seen in rectification.seen]
    doubts = []
    if max(black) > WORTH_A_REMARK:
        doubts.append(
            f"{black[0]:.1%} of the left and {black[1]:.1%} of the right pictures are black, since the cameras did not "
            "see what is there; --alpha 0 leaves the least of that"
        )
    calibration = rectification.calibration
    if calibration.doffs > 0:
        doubts.append(
            f"cx differs by {calibration.doffs:.1f} px, so far points have negative disparities; --alpha 0 or 1 makes "
            "them equal"
        )
    return doubts
