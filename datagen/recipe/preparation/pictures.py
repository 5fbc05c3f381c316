"""Preparing pictures of the user's: textures, and panoramas that light a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.formats.picture import read_picture
from datagen.recipe.preparation.mesh_materials import distinct
from datagen.recipe.preparation.mesh_surfaces import MAX_SIDE_PX
from datagen.recipe.preparation.meshes import REMARK
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import listed, shortened
from stereoforge_kit.srgb import to_linear

TEXTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp")
ENVIRONMENT_SUFFIXES = (".hdr", ".exr", *TEXTURE_SUFFIXES)
MEAN_LUMINANCE = 0.5
"""Environments are scaled to this, so that they light a scene as the generator's own skies do."""
SQUAREST = 1.9, 2.1
"""Width over height of a panorama of the whole sphere; others are stretched over it, with a remark."""
BEAUTY = ("combined", "beauty", "rgba", "rgb", "composite", "color")
"""Names of the layer, in small letters, that is the picture itself in EXR files of several."""


def prepare_texture(path: Path) -> dict[str, NDArray[np.generic]]:
    """A texture's `image`, (H, W, 3) uint8 sRGB, as `datagen.formats.picture` reads it.

    Raises FormatError for a file of no use.
    """
    return {"image": _bounded(read_picture(path, longest_px=MAX_SIDE_PX))}


def prepare_environment(path: Path) -> dict[str, NDArray[np.generic]]:
    """An environment's `radiance`, (H, W, 3) float32 linear RGB of mean `MEAN_LUMINANCE`.

    With a remark if some of it was infinite, if the file has several layers, or if it is no panorama of 2:1.

    Raises ValueError for a file of no use, and whatever the parser raises.
    """
    remarks: list[str] = []
    suffix = path.suffix.lower()
    if suffix == ".exr":
        radiance = _read_exr(path, remarks)
    elif suffix == ".hdr":
        radiance = _read_hdr(path)
    else:
        levels = np.asarray(_bounded(read_picture(path, longest_px=MAX_SIDE_PX)), np.float64) / 255
        radiance = to_linear(levels).astype(np.float32)
    if (infinite := np.isposinf(radiance)).any():
        # Half floats end at 65504, which a sun exceeds.
        brightest = max(float(radiance[np.isfinite(radiance)].max(initial=0)), 0.0)
        radiance = np.where(infinite, np.float32(brightest), radiance)
        remarks.append(f"its infinite values are taken for {brightest:g}, the brightest finite one")
    height, width = radiance.shape[:2]
    if not SQUAREST[0] <= width / height <= SQUAREST[1]:
        remarks.append(f"it is {width} x {height}, not 2:1, and is stretched over the whole sphere")
    radiance = np.nan_to_num(np.maximum(_bounded(radiance), 0), neginf=0.0)
    luminance = float(radiance.mean())
    if luminance <= 0:
        raise InputError("it is black")
    prepared: dict[str, NDArray[np.generic]] = {REMARK: np.array(distinct(remarks))} if remarks else {}
    return prepared | {"radiance": (radiance * (MEAN_LUMINANCE / luminance)).astype(np.float32)}


def _read_hdr(path: Path) -> NDArray[np.float32]:
    image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 3 or image.dtype != np.float32:
        raise InputError("it is no Radiance HDR picture")
    return np.ascontiguousarray(image[..., 2::-1])


def _read_exr(path: Path, remarks: list[str]) -> NDArray[np.float32]:
    """The picture of an EXR file: of its layers the one that is named as a picture, or else the first."""
    import OpenEXR

    layers: dict[str, dict[str, Any]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for number, part in enumerate(file.parts):
            for name, channel in part.channels.items():
                layer, _, letter = name.rpartition(".")
                layer = layer or (part.name() if number else "")
                layers.setdefault(layer, {})[letter.upper()] = channel
        pictures = [
            layer for layer, channels in layers.items() if {*"RGB"} <= channels.keys() or "Y" in channels
        ]
        if not pictures:
            raise InputError(f"it has no layer with R, G and B among {listed(list(layers))}")
        chosen = min(pictures, key=lambda layer: (layer != "", layer.lower().split(".")[-1] not in BEAUTY))
        if len(pictures) > 1:
            remarks.append(
                f"of its {len(pictures)} layers {shortened(chosen or 'the one without a name', 60)} is used"
            )
        channels = layers[chosen]
        names = "RGB" if {*"RGB"} <= channels.keys() else "YYY"
        if any(channels[name].xSampling > 1 or channels[name].ySampling > 1 for name in names):
            raise InputError("its channels have different sizes")
        planes = [np.asarray(channels[name].pixels, np.float32) for name in names]
    return np.stack(planes, axis=-1)


def _bounded(image: NDArray[np.generic]) -> NDArray[np.generic]:
    """The image, made smaller if it is larger than `MAX_SIDE_PX`."""
    longest = max(image.shape[:2])
    if longest <= MAX_SIDE_PX:
        return image
    size = tuple(max(1, length * MAX_SIDE_PX // longest) for length in image.shape[1::-1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
