"""`stereoforge app`: a page to try it."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np

from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import check_max_disparity, shown
from stereoforge.progress import console, remark

if TYPE_CHECKING:
    from stereoforge.pipelines.refiner import StereoRefiner

HIGHEST_PORT = 65535


@dataclass(frozen=True)
class App:
    """Open a page to try it: two pictures in, disparity, confidence, points and depth out.

    Serves this machine alone and fetches nothing from elsewhere. Ctrl-C ends it.
    """

    interrupted: ClassVar[str] = "the page is closed"

    host: Annotated[str, shown("ADDRESS")] = "127.0.0.1"
    """Address to listen on. 0.0.0.0 lets every machine that can reach this one use it, without a password."""
    port: Annotated[int, shown("N")] = 7860
    """Port to listen on; 0 takes a free one."""
    weights: Annotated[Path, shown("RUN", "the bundled weights")] = BUNDLED_WEIGHTS
    """Run folder with a regressor, a confnet and a gradnet. paper: the bundled networks of the paper."""
    predictor: Literal["networks", "sgbm"] = "networks"
    """What predicts the disparity: the run folder's networks, or OpenCV's semi-global matching."""
    max_disparity: Annotated[int | None, shown("PX", "chosen for the pictures")] = None
    """Largest disparity in pixels to look for. DispNetCorr1D looks as far as it was trained to."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Serve the page until interrupted."""
        check_max_disparity(self.max_disparity)
        if not 0 <= self.port <= HIGHEST_PORT:
            raise UsageError(f"--port must lie between 0 and {HIGHEST_PORT}, got {self.port}")
        if find_spec("gradio") is None:
            raise UsageError("the page needs Gradio: pip install 'stereoforge[app]'")
        from stereoforge.app.server import listening_socket, page_server, serve

        listening = listening_socket(self.host, self.port)
        with listening, tempfile.TemporaryDirectory(prefix="stereoforge-app-") as folder:
            with console.status("starting; the first time after an install this compiles for a minute"):
                from stereoforge.pipelines.refiner import StereoRefiner

                refiner = StereoRefiner(
                    self.weights,
                    predictor=self.predictor,
                    max_disparity=self.max_disparity,
                    device=self.device,
                )
                _warm_up(refiner)
                app = page_server(refiner, Path(folder))
            for note in refiner.notes:
                remark(note)
            host, port = listening.getsockname()[:2]
            console.print(
                f"the page is at http://{f'[{host}]' if ':' in host else host}:{port}; Ctrl-C ends it"
            )
            serve(app, listening)


def _warm_up(refiner: StereoRefiner) -> None:
    """Refine noise, so that the kernels are compiled before the first visitor's pair."""
    from stereoforge.pipelines.warming import PAIR_SIZE

    noise = np.random.default_rng(0).integers(0, 256, (*PAIR_SIZE, 3), dtype=np.uint8)
    refiner(noise, np.roll(noise, -4, axis=1))
