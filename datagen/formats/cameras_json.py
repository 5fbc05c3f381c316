"""Cameras of a scene's frames as JSON, in OpenCV's convention: `cameras.json`.

    {"width": 960, "height": 540, "fx": 1050.0, "fy": 1050.0, "cx_left": 479.5, "cx_right": 479.5, "cy": 269.5,
     "baseline_m": 0.12, "disparity_at_infinity": 0.0,
     "frames": {"6": {"left": {"K": [[...]], "camera_to_world": [[...]], "world_to_camera": [[...]]}, "right": ...}}}

The camera's x axis points right, y down, z forward, and the centre of the first pixel is (0, 0). Lengths are metres.
The numbers before `frames` are a rig that `stereoforge render --camera` reads (`datagen.cameras`).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from scenes.spec import StereoCamera
from stereoforge_kit.files import write_text

FIRST_PIXEL = 0.5
"""Where our convention has the centre of the first pixel, which OpenCV has at 0."""
FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""From a camera's frame with y down and z forward to one with y up that looks along -z."""


def rig_numbers(camera: StereoCamera) -> dict[str, float]:
    """Size, intrinsics and baseline of a rectified pair, and the disparity that they give what is infinitely far."""
    left, right = (camera.principal_point(view) for view in ("left", "right"))
    return {
        "width": camera.width,
        "height": camera.height,
        "fx": camera.focal_px,
        "fy": camera.focal_y_px,
        "cx_left": left[0] - FIRST_PIXEL,
        "cx_right": right[0] - FIRST_PIXEL,
        "cy": left[1] - FIRST_PIXEL,
        "baseline_m": camera.baseline_m,
        "disparity_at_infinity": camera.disparity_at_infinity,
    }


def camera_matrix(camera: StereoCamera, view: str) -> NDArray[np.float64]:
    """(3, 3) K of a view: K [X / Z, Y / Z, 1] is the pixel that shows the point (X, Y, Z) of the camera's frame."""
    x, y = camera.principal_point(view)
    return np.array(
        [
            [camera.focal_px, 0.0, x - FIRST_PIXEL],
            [0.0, camera.focal_y_px, y - FIRST_PIXEL],
            [0.0, 0.0, 1.0],
        ]
    )


def cameras_record(camera: StereoCamera, times: dict[int, float]) -> dict[str, Any]:
    """The cameras at every frame.

    Args:
        camera: Of the scene.
        times: The instant of each frame by its number on disk.
    """
    return {
        **rig_numbers(camera),
        "frames": {
            str(frame): {view: _view(camera, view, time) for view in ("left", "right")}
            for frame, time in times.items()
        },
    }


def _view(camera: StereoCamera, view: str, time: float) -> dict[str, Any]:
    camera_to_world = camera.pose(view, time) @ FROM_OPENCV
    turn, place = camera_to_world[:3, :3], camera_to_world[:3, 3]
    world_to_camera = np.eye(4)
    world_to_camera[:3, :3], world_to_camera[:3, 3] = turn.T, -turn.T @ place
    return {
        "K": camera_matrix(camera, view).tolist(),
        "camera_to_world": camera_to_world.tolist(),
        "world_to_camera": world_to_camera.tolist(),
    }


def write_cameras(path: Path, record: dict[str, Any]) -> None:
    """Write what `cameras_record` makes.

    >>> import tempfile
    >>> from scenes.spec import Trajectory
    >>> camera = StereoCamera(64, 32, 35.0, 0.2, Trajectory.static((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "cameras.json"
    ...     write_cameras(path, cameras_record(camera, {"0006": 5.0}))
    ...     read = read_cameras(path)
    >>> list(read["frames"]), read["baseline_m"]
    (['0006'], 0.2)
    """
    write_text(path, json.dumps(record) + "\n")


def read_cameras(path: Path) -> dict[str, Any]:
    """Read a `cameras.json`. Raises FormatError for a file that is missing or none."""
    try:
        record = json.loads(read_bounded(path, MAX_JSON_BYTES))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: is no JSON") from error
    if not isinstance(record, dict) or not isinstance(record.get("frames"), dict):
        raise FormatError(f"{path}: has no frames")
    return record
