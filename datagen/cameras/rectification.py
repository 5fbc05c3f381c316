"""Rectification of a raw pair: both cameras are turned so that their rows are the same, and distortion is undone.

J.-Y. Bouguet's method as `cv2.stereoRectify` has it: each camera takes half of the rotation between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration, from_projections
from datagen.cameras.raw_calibration import RawCalibration, RawView
from stereoforge_kit.errors import InputError

Interpolation = Literal["linear", "cubic", "lanczos"]
_INTERPOLATIONS: dict[Interpolation, int] = {
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "lanczos": cv2.INTER_LANCZOS4,
}
_LENS_GRID = 64
"""Points along each side of the image at which a lens must be invertible."""
_RETURNS_WITHIN_PX = 0.5
"""A lens counts as invertible where undistorting and distorting a point returns it so closely."""
_THOROUGHLY = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-8)
_FOLDED_SHARE = 0.02
"""Coefficients are fitted to where the calibration's targets were, which the very corners need not be."""

Maps = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass(frozen=True)
class Rectification:
    """How both pictures of a raw pair are warped, and the calibration of the result."""

    raw: RawCalibration
    rotations: tuple[NDArray[np.float64], NDArray[np.float64]]
    """R1 and R2, (3, 3): from each camera's frame to the rectified one's."""
    projections: tuple[NDArray[np.float64], NDArray[np.float64]]
    """P1 and P2, (3, 4): from the rectified left camera's frame, in metres, to pixels of each view."""
    calibration: Calibration
    """Of the rectified pictures, which have the raw ones' size."""

    @cached_property
    def maps(self) -> tuple[Maps, Maps]:
        """Of each view, x and y in the raw picture for each pixel of the rectified one, (H, W) each."""
        return self._maps(0), self._maps(1)

    @cached_property
    def seen(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(H, W) of each view: whether the raw picture shows what is there."""
        return self._seen(0), self._seen(1)

    def __call__(
        self,
        left: NDArray[np.uint8],
        right: NDArray[np.uint8],
        interpolation: Interpolation = "lanczos",
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Rectify both pictures, (H, W, 3) uint8; what the raw ones do not show is black.

        Raises ValueError for pictures of another size than the calibration's.
        """
        rectified = []
        for picture, maps, seen in zip((left, right), self.maps, self.seen, strict=True):
            size = (picture.shape[1], picture.shape[0])
            if size != self.raw.size:
                raise InputError(
                    "the calibration is of pictures of {}x{}, but this is {}x{}".format(*self.raw.size, *size)
                )
            # Black beyond the border would darken the last pixels, so the border goes on and is cut off.
            warped = cv2.remap(
                picture, *maps, _INTERPOLATIONS[interpolation], borderMode=cv2.BORDER_REPLICATE
            )
            rectified.append(np.where(seen[..., None], warped, 0).astype(np.uint8))
        return rectified[0], rectified[1]

    def _maps(self, index: int) -> Maps:
        view, rotation, projection = self._of(index)
        make = cv2.fisheye.initUndistortRectifyMap if view.model == "fisheye" else cv2.initUndistortRectifyMap
        x, y = make(view.matrix, view.distortion, rotation, projection[:, :3], self.raw.size, cv2.CV_32FC1)
        return x, y

    def _seen(self, index: int) -> NDArray[np.bool_]:
        width, height = self.raw.size
        x, y = self.maps[index]
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
        # Beyond the largest radius that a polynomial reaches it comes back and shows the picture mirrored.
        (x_down, x_along), (y_down, y_along) = np.gradient(x), np.gradient(y)
        return inside & self._before(index) & (x_along * y_down > x_down * y_along)

    def _before(self, index: int) -> NDArray[np.bool_]:
        """(H, W): whether a pixel of the rectified picture looks at what is before the raw camera, not behind it."""
        _, rotation, projection = self._of(index)
        width, height = self.raw.size
        # The z of R' K^-1 (x, y, 1).
        of_x, of_y, of_one = (rotation.T @ np.linalg.inv(projection[:, :3]))[2]
        return of_x * np.arange(width)[None] + of_y * np.arange(height)[:, None] + of_one > 0

    def _of(self, index: int) -> tuple[RawView, NDArray[np.float64], NDArray[np.float64]]:
        view = (self.raw.left, self.raw.right)[index]
        return view, self.rotations[index], self.projections[index]


def plan_rectification(raw: RawCalibration, alpha: float | None = None) -> Rectification:
    """How a raw pair is rectified.

    Args:
        raw: Its calibration.
        alpha: From 0, as much as leaves hardly a pixel black, to 1, all that the cameras took. None for the
            rectification that the file holds and, without one, OpenCV's own choice: the focal length of the cameras,
            of fisheyes alpha 0.

    Raises:
        ValueError: For cameras above one another, swapped views, and lenses that the coefficients do not describe.
    """
    for name, view in (("left", raw.left), ("right", raw.right)):
        _check_lens(view, raw.size, name)
    if alpha is None and raw.own is not None:
        rotations, projections = raw.own.rotations, raw.own.projections
    else:
        rotations, projections = _bouguet(raw, alpha)
    if abs(projections[1][1, 3]) > abs(projections[1][0, 3]):
        raise InputError("its cameras are above one another, not side by side: turn the pictures first")
    calibration = from_projections(projections[0], projections[1], raw.size)
    return Rectification(raw, rotations, projections, calibration)


def _bouguet(
    raw: RawCalibration, alpha: float | None
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    cameras = (raw.left.matrix, raw.left.distortion, raw.right.matrix, raw.right.distortion, raw.size)
    if raw.left.model == "fisheye":
        r1, r2, p1, p2, _ = cv2.fisheye.stereoRectify(
            *cameras,
            raw.rotation,
            raw.translation_m,
            cv2.fisheye.CALIB_ZERO_DISPARITY,
            balance=0.0 if alpha is None else alpha,
        )
    else:
        r1, r2, p1, p2, *_ = cv2.stereoRectify(
            *cameras, raw.rotation, raw.translation_m, alpha=-1 if alpha is None else alpha
        )
    return (r1, r2), (p1, p2)


def _check_lens(view: RawView, size: tuple[int, int], name: str) -> None:
    """Raise ValueError where coefficients fold the picture, as those of another lens model or another size do.

    A fisheye may see what is behind it, where no rectified picture reaches, so its are not checked.
    """
    if view.model == "fisheye":
        return
    sides = [np.linspace(0, side - 1, _LENS_GRID) for side in size]
    grid = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 1, 2)
    rays = cv2.undistortPointsIter(grid, view.matrix, view.distortion, None, None, _THOROUGHLY)
    again, _ = cv2.projectPoints(
        cv2.convertPointsToHomogeneous(rays), np.zeros(3), np.zeros(3), view.matrix, view.distortion
    )
    folded = ~(np.abs(again - grid).max(axis=(1, 2)) <= _RETURNS_WITHIN_PX)
    if folded.mean() > _FOLDED_SHARE:
        raise InputError(
            f"its distortion folds {folded.mean():.0%} of the {name} picture: is it of another lens model or size?"
        )
