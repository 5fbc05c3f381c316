"""`stereoforge refine`: one pair of pictures to a refined disparity."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from stereoforge.errors import CommandError
from stereoforge.images import read_color_image
from stereoforge.progress import console
from stereoforge.values import shown


@dataclass(frozen=True)
class Refine:
    """Predict disparity, confidence and gradients of a rectified pair, and refine the disparity with the MRF.

    Writes disparity.pfm, disparity_initial.pfm, confidence.pfm, gradient.exr and overview.png.
    """

    left: Annotated[tyro.conf.Positional[Path], shown("LEFT")]
    """Left picture (PNG, JPEG, TIFF, ...)."""
    right: Annotated[tyro.conf.Positional[Path], shown("RIGHT")]
    """Right picture, rectified and of the same size."""
    out: Annotated[Path, shown("DIR")]
    """Folder for the results."""
    weights: Annotated[Path, shown("RUN")]
    """Run folder with a regressor, a confnet and a gradnet."""
    form: Literal["exact", "paper"] = "exact"
    """exact minimises the energy; paper solves the paper's eq. 8 as printed."""
    device: Annotated[str, shown("NAME")] = "cpu"
    """What the networks run on: cpu, cuda, ..."""

    def run(self) -> None:
        left, right = read_color_image(self.left), read_color_image(self.right)
        from datagen.formats import write_gradient, write_pfm, write_png
        from datagen.ground_truth import gradient_validity
        from refine.mrf import solve_mrf
        from refine.overview import overview_picture
        from training.predict import StereoPredictor

        prediction = StereoPredictor(self.weights, self.device).predict(left, right)
        if prediction.confidence is None or prediction.gradient is None:
            missing = "confnet" if prediction.confidence is None else "gradnet"
            raise CommandError(f"{self.weights}: has no {missing}, which refining needs; train one into it")
        solution = solve_mrf(
            prediction.disparity, prediction.confidence, prediction.gradient, left, form=self.form
        )
        refined = solution.disparity.astype("float32")
        # The networks predict a slope everywhere; only the differences inside the image exist.
        inside = gradient_validity(prediction.gradient, float("inf"))
        self.out.mkdir(parents=True, exist_ok=True)
        write_pfm(self.out / "disparity.pfm", refined)
        write_pfm(self.out / "disparity_initial.pfm", prediction.disparity)
        write_pfm(self.out / "confidence.pfm", prediction.confidence)
        write_gradient(self.out / "gradient.exr", prediction.gradient, inside)
        picture = overview_picture(left, prediction.disparity, prediction.confidence, refined)
        write_png(self.out / "overview.png", picture)
        console.print(
            f"{self.out}: disparity {refined.min():.1f} to {refined.max():.1f} px, refined in "
            f"{solution.info.seconds:.2f} s ({solution.info.solver}); look at {self.out / 'overview.png'}"
        )
