"""Refine a pair with exported networks: onnxruntime and numpy, no torch.

python onnx_refine.py stereoforge.onnx left.png right.png disparity.pfm
"""

import sys

import numpy as np
import onnxruntime

from datagen.formats import write_pfm
from datagen.formats.picture import read_picture
from refine import refine_disparity

MULTIPLE = 64
"""Sides of the pictures that the networks take are multiples of this."""


def padded(picture):
    """(1, 3, H, W) in 0..1, the last row and column repeated to the next multiples."""
    missing = [-length % MULTIPLE for length in picture.shape[:2]]
    larger = np.pad(picture, [(0, missing[0]), (0, missing[1]), (0, 0)], mode="edge")
    return larger.transpose(2, 0, 1)[None].astype(np.float32) / 255


def main(model, left_path, right_path, out):
    """Predict, refine and write the disparity."""
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    left, right = read_picture(left_path), read_picture(right_path)
    height, width = left.shape[:2]
    names = [output.name for output in session.get_outputs()]
    answers = session.run(names, {"left": padded(left), "right": padded(right)})
    found = {name: maps[0, :, :height, :width] for name, maps in zip(names, answers, strict=True)}
    refined = refine_disparity(
        found["disparity"][0], found["confidence"][0], found["gradient"].transpose(1, 2, 0), left
    )
    write_pfm(out, refined)


if __name__ == "__main__":
    main(*sys.argv[1:])
