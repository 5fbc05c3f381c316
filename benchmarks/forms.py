"""The two forms of the refinement, exact and as printed, on the test split of data sets.

`python -m benchmarks.forms --weights RUN --data DATA...`: errors and solve times (networks apart) of both forms with
the default parameters and, where RUN has validated ones, with those. The validated parameters are those of the
form that `stereoforge tune` was run on, here put to both.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from refine.evaluation.evaluate import evaluate
from refine.method import Method
from refine.methods.ours_quadratic import OursQuadratic
from refine.methods.regressor import Regressor
from stereoforge.pipelines.prediction import open_predictors, open_settings, parameters_file
from stereoforge.pipelines.set_evaluation import evaluation_options, open_test_data
from training.prediction.predictor import StereoPredictor


@dataclass(frozen=True)
class Paper(OursQuadratic):
    """The same method, its other form a row of its own."""

    name: ClassVar[str] = "paper"
    label: ClassVar[str] = "Ours, as printed"


def both_forms(ours: OursQuadratic) -> list[Method]:
    fields = {"parameters": ours.parameters, "shape": ours.shape}
    return [replace(ours, form="exact"), Paper(form="paper", **fields)]  # type: ignore[arg-type]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", nargs="+", required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--split", default="test", choices=("train", "val", "test"))
    options = parser.parse_args()
    predictors = open_predictors(options.weights)
    assert isinstance(predictors.initial, StereoPredictor)
    settings = {"default": OursQuadratic()}
    if parameters_file(options.weights).exists():
        settings["validated"] = open_settings(None, options.weights).ours_quadratic
    print("| set | parameters | form | EPE, px | > 1 px, % | gradient, smooth | gradient, all | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    for data in open_test_data(options.data, options.split):
        frames = [predictors.frame(frame) for frame in data.frames]
        for method in both_forms(OursQuadratic()):
            method.run(frames[0])  # compiles
        for chosen, ours in settings.items():
            rows: list[Method] = both_forms(ours)
            if chosen == "default":
                rows.insert(0, Regressor())
            scores = evaluate(frames, rows, evaluation_options(data.family)).scores
            for name, score in scores.items():
                form = {"ours_quadratic": "exact", "regressor": "not refined"}.get(name, name)
                region, seconds = score.regions["all"], "" if name == "regressor" else f"{score.seconds:.3f}"
                print(
                    f"| {data.name} | {chosen if form != 'not refined' else ''} | {form} | {region.epe:.3f} "
                    f"| {region.bad * 100:.2f} | {score.gradient_masked:.4f} | {score.gradient_all:.4f} | {seconds} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
