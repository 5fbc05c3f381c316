"""`model_card.md` beside the weights: what each network of a run folder is and how it was trained."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from stereoforge_kit.files import write_text
from training.presets import TASKS
from training.runs.weights import TrainingSummary, has_weights, read_summary, regressor_title, weights_path

FILE_NAME = "model_card.md"
"""Name of the model card in a run folder."""
_WHAT = {
    "regressor": "{title}: disparity of the left view from a rectified pair",
    "regressor_f": "{title} fine-tuned on disparity gradients too (eq. 9 of the paper)",
    "confnet": "ConfNet: the probability that a disparity of `regressor` is correct",
    "gradnet": "GradNet: forward differences of the disparity",
    "confnet_free": "Regressor-free ConfNet: for the disparity of any predictor",
    "gradnet_free": "Regressor-free GradNet: for the disparity of any predictor",
}
_FIGURES = {
    "epe": "end-point error, px",
    "bad1": "share of pixels off by more than 1 px",
    "bad3": "share of pixels off by more than 3 px",
    "refined_epe": "end-point error of the refined disparity, px",
    "refined_bad1": "share of pixels off by more than 1 px once refined",
    "refined_gradient": "gradient error of the refined disparity on smooth pixels, px per px",
    "gradient": "gradient error on smooth pixels, px per px",
    "gradient_regressor": "the regressor's gradient error there",
    "gradient_matched": "the matcher's gradient error there",
    "auc": "area under the sparsification curve",
    "auc_random": "area of a random order",
    "auc_optimal": "area of the best order",
}


def _what(run: Path, task: str) -> str:
    said = _WHAT[task]
    return said.format(title=regressor_title(run, task)) if "{title}" in said else said


def write_model_card(run: Path, folder: Path | None = None) -> Path:
    """Write the model card of all networks of a run folder.

    Args:
        run: The run folder.
        folder: Where to write the card; the run folder if None.

    Returns:
        The card's path.

    Raises:
        TrainingError: a description beside the weights is damaged.
    """
    lines = [
        "# Model card",
        "",
        "Networks of *Learning to refine depth for robust stereo estimation* (Cheng, He, Zhang, 2018), trained from "
        "scratch with StereoForge. Input: rectified colour pairs; disparities are pixels of the input. The weights "
        "are safetensors (numbers only) with a JSON description each.",
    ]
    for task in TASKS:
        if has_weights(run, task):
            lines += ["", f"## {weights_path(run, task).name}", "", f"{_what(run, task)}.", ""]
            lines += _describe(read_summary(run, task))
    lines += [
        "",
        "## Limits",
        "",
        "The networks were trained on rendered worlds, unless the data above says otherwise. They are less accurate on "
        "photographs, on disparities beyond those of the training set, and where matching is ambiguous (sky, glass, "
        "repetition). The figures are those of validation frames, which mostly come from the same source as the "
        "training set.",
    ]
    path = (folder or run) / FILE_NAME
    write_text(path, "\n".join(lines) + "\n")
    return path


def _describe(summary: TrainingSummary) -> Iterator[str]:
    yield "| | |"
    yield "|---|---|"
    yield f"| preset | {summary.preset} |"
    yield f"| steps | {summary.best_step} of {summary.steps} (the best by validation) |"
    yield f"| seed | {summary.seed} |"
    for (source, weight), fingerprint in zip(summary.data, summary.fingerprints, strict=True):
        yield f"| data, weight {weight:g} | {source}: {fingerprint} |"
    for name, value in summary.validation.items():
        yield f"| validation: {_FIGURES.get(name, name)} | {value:.4g} |"
    if not summary.validation:
        yield "| validation | none: the last weights are kept |"
    yield f"| code | {summary.revision} |"
    if summary.started_from is not None:
        yield from ("", "It started from weights that were trained so:", "")
        yield from _describe(summary.started_from)
