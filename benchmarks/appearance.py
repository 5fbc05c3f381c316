"""How the pictures of a data set look, in numbers: textureless, clipped, black, reflective pixels, and disparities.

    python -m benchmarks.appearance DIR [--split val] [--render-pass clean]

A pixel is textureless where the grey levels of the 5 x 5 pixels around it differ by at most `TEXTURELESS_LEVELS`,
clipped where a channel is 255, black where one is 0. Figures are of the left views of all frames; the table gives
their median and 5th and 95th percentile over the frames.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen import StereoDataset, StereoSample
from datagen.ground_truth.targets import reflective

TEXTURELESS_LEVELS = 4
"""Largest difference of grey levels, 0..255, within 5 x 5 pixels that counts as no texture."""
WIDTH = 960
"""Disparities are given in pixels at this width."""


def textureless(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(H, W) where a picture (H, W, 3) has no texture."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    window = np.ones((5, 5), np.uint8)
    return cv2.dilate(grey, window).astype(int) - cv2.erode(grey, window) <= TEXTURELESS_LEVELS


def measured(sample: StereoSample) -> dict[str, float]:
    """Shares of the pixels in per cent, and percentiles of the disparity."""
    image = sample.left
    disparity = sample.disparity_left * (WIDTH / image.shape[1])
    plain = textureless(image)
    # The first material of each object: of several, as users' meshes have them, only a target would tell which is seen.
    worn = np.array([0, *(1 + thing.material for thing in sample.scene_record.objects)])
    near = disparity > np.median(disparity)
    low, middle, high = np.percentile(disparity, (1, 50, 99))
    shares = {
        "textureless": plain.mean(),
        "textureless, of the nearer half": plain[near].mean() if near.any() else plain.mean(),
        "clipped": (image == 255).any(axis=2).mean(),
        "black": (image == 0).any(axis=2).mean(),
        "reflective": (reflective(sample.scene_record, worn[sample.object_index_left]) > 0).mean(),
    }
    pixels = {"disparity, 1 %": low, "disparity, median": middle, "disparity, 99 %": high}
    return {name: 100 * float(share) for name, share in shares.items()} | {
        name: float(value) for name, value in pixels.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--render-pass", choices=("clean", "final"), default="clean")
    arguments = parser.parse_args()
    samples = StereoDataset(arguments.data, arguments.split, render_pass=arguments.render_pass)
    figures = [measured(sample) for sample in samples]
    print(f"{len(figures)} frames | median | 5 % | 95 %")
    for name in figures[0]:
        middle, low, high = np.percentile([frame[name] for frame in figures], (50, 5, 95))
        print(f"{name} | {middle:.1f} | {low:.1f} | {high:.1f}")


if __name__ == "__main__":
    main()
