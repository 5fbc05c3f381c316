"""Make the strips of the README and docs/families: scenes of a data set in columns, images over ground truth.

python docs/pictures/strip.py DATA OUT.jpg [--split test] [--scenes 0 3 5 8] [--width 400] [--rows 4]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2

from datagen import StereoDataset, StereoSample
from stereoforge_kit.viewing import (
    Picture,
    disparity_picture,
    gradient_picture,
    occlusion_picture,
    side_by_side,
    stacked,
)


def column(sample: StereoSample, width: int, rows: int) -> Picture:
    """The first `rows` of left image, disparity, occlusion and gradients, top to bottom."""
    pictures = [
        sample.left,
        disparity_picture(sample.disparity_left),
        occlusion_picture(sample.occlusion_left, sample.left),
        gradient_picture(sample.gradient_left, 0.25),
    ][:rows]
    height = round(width * sample.left.shape[0] / sample.left.shape[1])
    return stacked([cv2.resize(item, (width, height), interpolation=cv2.INTER_AREA) for item in pictures])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--split", default="test")
    parser.add_argument("--scenes", type=int, nargs="+", default=[0, 1, 2, 3])
    parser.add_argument("--width", type=int, default=400)
    parser.add_argument("--rows", type=int, default=4)
    arguments = parser.parse_args()
    first_frames = {
        int(sample.name.split("/")[2]): sample
        for sample in reversed(StereoDataset(arguments.data, arguments.split))
    }
    picture = side_by_side(
        [column(first_frames[scene], arguments.width, arguments.rows) for scene in arguments.scenes]
    )
    cv2.imwrite(str(arguments.out), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
