"""The page's layout in Gradio, and what happens on it."""

from __future__ import annotations

import html
import itertools
import secrets
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gradio as gr

from datagen.cameras.calibration import Calibration
from stereoforge.app.examples import FOLDER, examples, is_of_example
from stereoforge.app.model import write_model
from stereoforge.app.results import (
    FILE_CONTENTS,
    Found,
    calibration_of,
    find,
    find_again,
    pictures_of,
    point_cloud,
    read_pair,
    rig_of,
    summary,
    value_at,
    write_files,
)
from stereoforge.inputs.rig_flags import KnownRig, SimpleRig
from stereoforge.pipelines.refiner import StereoRefiner
from stereoforge_kit.errors import UserError
from stereoforge_kit.messages import LONGEST_MESSAGE, shortened

TITLE = "StereoForge"
INTRODUCTION = (
    "# StereoForge\nDisparity of a rectified stereo pair, and what refining makes of it. Drop two pictures, or pick a "
    "rendered example. Nothing leaves the machine that runs this page."
)
HINT = (
    "Press on a picture below to read a pixel. Bright disparities are near; yellow is confident, blue is not."
)
STRENGTHS = [
    ("a tenth", 0.1),
    ("a third", 1 / 3),
    ("as validated", 1.0),
    ("3 times", 3.0),
    ("10 times", 10.0),
]
MIN_CONFIDENCE = 0.3
LARGEST_FILE = "64mb"
KEPT_S = 3600
"""How long what was dropped, and what is shown, is kept after it was last used."""
SWEEP_S = 600
KEPT_RESULTS = 30
"""Folders of files to download; their names cannot be guessed."""
STYLE = Path(__file__).with_name("page.css")
UNCALIBRATED = (
    "without a calibration the points' shape is a guess (a focal length as long as the picture is wide), so there is "
    "no points.ply"
)


@dataclass(frozen=True)
class Shown:
    """What the page shows: a result and the calibration of its pair."""

    found: Found
    calibration: Calibration | None
    model: Path | None
    """Of its points, if there are any."""


def build_page(refiner: StereoRefiner, folder: Path) -> gr.Blocks:
    """The page.

    Args:
        refiner: Serves one visitor at a time.
        folder: Where files to download are written, one folder for each result.
    """
    with gr.Blocks(
        title=TITLE, analytics_enabled=False, delete_cache=(SWEEP_S, KEPT_S), fill_width=True
    ) as page:
        gr.Markdown(INTRODUCTION)
        with gr.Row():
            left = _picture_input("Left picture", "left-input")
            right = _picture_input("Right picture", "right-input")
            with gr.Column(min_width=280):
                chosen = gr.Dataset(
                    label="Rendered examples",
                    components=[gr.Image(render=False)],
                    samples=[[str(example.left)] for example in examples()],
                    type="index",
                    layout="gallery",
                    elem_id="examples",
                )
                go = gr.Button("Refine", variant="primary", elem_id="go")
        with gr.Accordion("Calibration, for depth and points", open=False, elem_id="calibration"):
            rig = _rig_inputs()
        status = gr.HTML(_said([]), padding=False, elem_id="status")
        shown = gr.State(None, time_to_live=KEPT_S)
        with gr.Column(visible=False, elem_id="results") as results:
            settings = _settings()
            outputs = _result_outputs()
        every = [status, results, shown, *(part for name, part in outputs.items() if name != "model")]
        actions = _Actions(refiner, folder)
        one_at_a_time: dict[str, Any] = {"concurrency_limit": 1, "concurrency_id": "refiner"}
        inputs = [left, right, *settings, *rig]
        changes = [settings[0].input, settings[1].release, rig[0].upload, rig[0].clear]
        changes += [event for number in rig[1:] for event in (number.submit, number.blur)]
        for event in (
            go.click(actions.show_pair, inputs, every, **one_at_a_time),
            gr.on([left.upload, right.upload], actions.forget_example, rig[0], rig[0]).then(
                actions.show_pair, inputs, every, **one_at_a_time
            ),
            chosen.click(actions.fill_in, chosen, [left, right, *rig]).then(
                actions.show_pair, inputs, every, **one_at_a_time
            ),
            gr.on(changes, actions.show_again, [shown, *settings, *rig], every, **one_at_a_time),
        ):
            # A viewer that becomes visible and gets its first model in one step stays empty (Gradio 6.31).
            event.then(actions.show_model, shown, outputs["model"])
        for name in ("left", "confidence", "refined"):
            outputs[name].select(actions.read_value, shown, outputs["reading"], show_progress="hidden")
    return page


def page_settings(folder: Path) -> dict[str, Any]:
    """What `gradio.mount_gradio_app` takes for the page: no fonts from elsewhere, no links, no other files."""
    font = ["system-ui", "sans-serif"]
    return {
        "theme": gr.themes.Default(font=font, font_mono=["ui-monospace", "monospace"]),
        "css_paths": [STYLE],
        "footer_links": [],
        "run_history": False,
        "ssr_mode": False,
        "mcp_server": False,
        "max_file_size": LARGEST_FILE,
        "allowed_paths": [str(FOLDER), str(folder)],
    }


class _Actions:
    """What happens when something is pressed; each returns values for components of the page."""

    def __init__(self, refiner: StereoRefiner, folder: Path) -> None:
        self._refiner = refiner
        self._folder = folder
        self._numbers = itertools.count()

    def fill_in(self, index: int) -> list[Any]:
        """An example's pictures and calibration into the inputs."""
        example = examples()[index]
        return [str(example.left), str(example.right), str(example.calibration), None, None, None]

    def forget_example(self, calibration: str | None) -> Any:
        """Clear an example's calibration when a picture is dropped: it would give wrong depths."""
        return None if calibration is not None and is_of_example(Path(calibration)) else gr.skip()

    def show_pair(
        self, left: Path | None, right: Path | None, strength: float, min_confidence: float, *rig: Any
    ) -> list[Any]:
        """Find everything for two pictures."""
        if left is None and right is None:
            return _only(_said(["drop two pictures, or pick an example"]))
        if left is None or right is None:
            return _only(_said([f"now drop the {'left' if left is None else 'right'} picture"]))
        return self._guarded(
            lambda: find(self._refiner, read_pair(left, right), strength), min_confidence, rig
        )

    def show_again(self, shown: Shown | None, strength: float, min_confidence: float, *rig: Any) -> list[Any]:
        """The same pair with other settings."""
        if shown is None:
            return [gr.skip()] * (3 + len(_OUTPUTS))
        return self._guarded(lambda: find_again(self._refiner, shown.found, strength), min_confidence, rig)

    def read_value(self, shown: Shown | None, event: gr.SelectData) -> str:
        """The values of the pixel that was pressed."""
        if shown is None:
            return HINT
        x, y = event.index
        return value_at(shown.found.refined, shown.calibration, int(x), int(y)) or HINT

    def show_model(self, shown: Shown | None) -> str | None:
        """The points of what is shown."""
        return None if shown is None or shown.model is None else str(shown.model)

    def _guarded(
        self, find_it: Callable[[], Found], min_confidence: float, rig: tuple[Any, ...]
    ) -> list[Any]:
        """Values for every output, or one sentence and no results."""
        try:
            return self._values(find_it(), min_confidence, rig_of(*rig))
        except UserError as error:
            return _only(_said([str(error)], wrong=True))
        except (MemoryError, RuntimeError) as error:  # torch says so when a device has no memory left
            return _only(_said([f"this pair could not be refined: {error or 'out of memory'}"], wrong=True))

    def _values(self, found: Found, min_confidence: float, rig: KnownRig | None) -> list[Any]:
        calibration, remarks = calibration_of(rig, found.pair)
        height, width = found.refined.disparity.shape
        supposed = calibration or SimpleRig(float(width), 1.0, 0.0).scaled_to((width, height))
        points, colors, left_out = point_cloud(found, supposed, min_confidence)
        folder = self._folder / f"{next(self._numbers):06d}-{secrets.token_hex(16)}"
        model = None
        if len(points):
            write_model(model := folder / "points.glb", points, colors)
        files, said = write_files(folder, found, None if calibration is None else (points, colors))
        left_out = left_out if calibration is not None else UNCALIBRATED
        initial, refined, confidence = pictures_of(found.refined)
        self._forget_old()
        return [
            _said([*summary(found), *remarks, *said]),
            gr.update(visible=True),
            Shown(found, calibration, model),
            (initial, refined),
            found.pair.left,
            confidence,
            refined,
            HINT,
            _sentence(left_out),
            _links(files),
        ]

    def _forget_old(self) -> None:
        """Remove the oldest results."""
        for folder in sorted(self._folder.iterdir())[:-KEPT_RESULTS]:
            shutil.rmtree(folder)


_OUTPUTS = ("slider", "left", "confidence", "refined", "reading", "left_out", "files")
"""What shows a result at once; the points' model follows."""


def _picture_input(label: str, name: str) -> Any:
    """A place to drop a picture, which gives the file that was dropped."""
    picture = gr.Image(
        label=label, type="filepath", sources=["upload"], height=200, min_width=140, buttons=[], elem_id=name
    )
    # Gradio's own reader would answer a broken picture with an error of its own. (A class would have it write a .pyi
    # file beside this one. Nothing may answer with a gradio.update of this component: that makes it anew.)
    picture.preprocess = lambda dropped: None if dropped is None else Path(dropped.path)
    return picture


def _rig_inputs() -> list[Any]:
    """Calibration file, focal length in px, baseline in m, doffs in px."""
    with gr.Row():
        file = gr.File(label="Calibration file", height=110, min_width=260, elem_id="calibration-file")
        focal = gr.Number(label="or focal length, px", value=None, min_width=150)
        baseline = gr.Number(label="and baseline, m", value=None, min_width=150)
        doffs = gr.Number(label="and doffs, px", value=None, min_width=150)
    return [file, focal, baseline, doffs]


def _settings() -> list[Any]:
    """Strength of the refinement, least confidence of a point."""
    with gr.Row():
        strength = gr.Radio(
            STRENGTHS,
            value=1.0,
            label="Strength of the refinement",
            scale=3,
            min_width=320,
            elem_id="strength",
        )
        floor = gr.Slider(
            0,
            1,
            MIN_CONFIDENCE,
            step=0.05,
            label="Least confidence of a point",
            scale=2,
            min_width=320,
            elem_id="floor",
        )
    return [strength, floor]


def _result_outputs() -> dict[str, Any]:
    """The components of `_OUTPUTS`, in this order, and the model."""
    picture: dict[str, Any] = {
        "interactive": False,
        "format": "png",
        "buttons": ["fullscreen"],
        "min_width": 260,
    }
    slider = gr.ImageSlider(
        label="Disparity: initial | refined",
        format="png",
        interactive=False,
        buttons=["fullscreen"],
        max_height=620,
        elem_id="slider",
    )
    reading = gr.Markdown(HINT, elem_id="reading")
    with gr.Row():
        left = gr.Image(label="Left picture", elem_id="left", **picture)
        confidence = gr.Image(label="Confidence", elem_id="confidence", **picture)
        refined = gr.Image(label="Refined disparity", elem_id="refined", **picture)
    with gr.Row():
        with gr.Column(scale=2, min_width=300):
            model = gr.Model3D(label="Points: drag to turn", height=420, interactive=False, elem_id="model")
            left_out = gr.Markdown(elem_id="left-out")
        with gr.Column(scale=1, min_width=260):
            files = gr.HTML(padding=False, elem_id="files")
    return dict(zip(_OUTPUTS, (slider, left, confidence, refined, reading, left_out, files), strict=True)) | {
        "model": model
    }


def _only(status: str) -> list[Any]:
    """Values for every output: a sentence, and no results."""
    return [status, gr.update(visible=False), None, *[None] * len(_OUTPUTS)]


def _said(sentences: list[str], wrong: bool = False) -> str:
    """Sentences as the page shows them, each with a capital and a full stop."""
    lines = [
        f"<p>{html.escape(_sentence(shortened(sentence, LONGEST_MESSAGE)))}</p>" for sentence in sentences
    ]
    role = "alert" if wrong else "status"
    return f'<div class="said {role}" role="{role}">{"".join(lines)}</div>' if lines else ""


def _links(files: list[Path]) -> str:
    """Links to download files, and what is in them."""
    rows = [
        f'<li><a href="gradio_api/file={html.escape(file.as_posix())}" download="{file.name}">{file.name}</a> '
        f"<span>{FILE_CONTENTS[file.name]}, {-(-file.stat().st_size // 1000):,} kB</span></li>"
        for file in files
    ]
    return f"<h3>Download</h3><ul>{''.join(rows)}</ul>"


def _sentence(text: str) -> str:
    """With a capital, unless it begins with the name of a file, and a full stop."""
    capital = text[:1].upper() if text.split(" ")[0].isalpha() else text[:1]
    return f"{capital}{text[1:]}{'' if text.endswith(('.', '?', '!')) else '.'}"
