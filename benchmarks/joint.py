"""Training ConfNet and GradNet through the refinement against training them on their own losses for as long.

`python -m benchmarks.joint --data DATA --weights RUN --out DIR [--test DATA]`: both start from RUN's networks and see
the same crops, optimizer and number of steps; what differs is the loss. The weights of either are kept by the refined
disparity's error on the validation split. Prints the errors on the test split. Interrupted, it continues.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from refine.evaluation.pooling import MethodScore
from refine.evaluation.results import mean_aucs
from stereoforge.pipelines.prediction import open_predictors, open_settings, parameters_file
from stereoforge.pipelines.set_evaluation import evaluate_set, open_test_data
from training.presets import find_preset
from training.runs.request import TrainingRequest
from training.runs.train import train
from training.runs.weights import has_weights

METHODS = ("gradnet", "ours_quadratic")


def further(options: argparse.Namespace, name: str, refined_weight: float) -> Path:
    """The run folder of one way of training further."""
    out = Path(options.out) / f"{name}_{options.seed}"
    request = TrainingRequest(
        task="joint",
        data=tuple((source, 1.0) for source in options.data),
        out=out,
        preset=options.preset,
        changes={"refined_weight": refined_weight},
        init=options.weights,
        refinement=open_settings(None, options.weights).ours_quadratic,
        resume=has_weights(out, "confnet"),
        steps=options.steps,
        seed=options.seed,
    )
    train(request)
    if parameters_file(options.weights).exists():
        shutil.copy(parameters_file(options.weights), out)
    return out


def row(tested: str, name: str, scores: dict[str, MethodScore], auc: float) -> str:
    refined, gradnet = scores["ours_quadratic"], scores["gradnet"]
    region = refined.regions["all"]
    numbers = f"{region.epe:.3f} | {region.bad * 100:.2f} | {refined.gradient_masked:.4f}"
    return f"| {tested} | {name} | {numbers} | {auc:.4f} | {gradnet.gradient_masked:.4f} |"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", nargs="+", required=True)
    parser.add_argument(
        "--test", nargs="+", help="sets whose test splits are evaluated; else those of --data"
    )
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--preset", default="tiny")
    parser.add_argument("--steps", type=int)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    weight = find_preset("joint", options.preset).refined_weight  # type: ignore[attr-defined]
    runs = {
        "start": options.weights,
        "own losses": further(options, "own", 0.0),
        "joint": further(options, "joint", weight),
    }
    print("| set | networks | EPE, px | > 1 px, % | gradient | ConfNet's AUC | GradNet's gradient |")
    print("|---|---|---|---|---|---|---|")
    for name, run in runs.items():
        methods = open_settings(None, run).rows(METHODS)
        for each in open_test_data(options.test or options.data, "test"):
            evaluation = evaluate_set(each, open_predictors(run), methods).evaluation
            print(row(each.name, name, evaluation.scores, mean_aucs(evaluation)["confnet"]), flush=True)


if __name__ == "__main__":
    main()
