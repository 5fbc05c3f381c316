"""The small presets' open choices, one changed at a time, with equal budgets on the same validation frames.

    python -m benchmarks.ablations --data DATASET --out DIR [--steps 1500] [--head-steps 600] [--only NAME ...]
    python -m benchmarks.ablations --data DATASET --graded DATASET --out DIR --only curriculum
    python -m benchmarks.ablations --out DIR --table        # what is finished so far, as Markdown

Each row trains one network from the same seed; heads stand on `--regressor RUN`, or on the group `regressor`'s own
`base`. A row that is finished is not trained again, so a stopped comparison continues. The figures are those of the
kept (best) weights on the data set's val split, which the test sets share nothing with. Where the run that heads stand
on has the other head too, ConfNet's rows are also judged by one rule for all thresholds of its labels: areas at 1 and
3 px, and the refinement's errors with that run's parameters.

`--graded` is a set like `--data` of which a part was rendered from simple to complex (`render --curriculum`).
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.sources.registry import open_source
from refine.evaluation.tuning import measure
from refine.metrics import sparsification_curve
from stereoforge.pipelines.prediction import open_predictors, open_settings
from training.metrics import AUC_STEPS
from training.networks import DispNetConfig
from training.networks.regressors.dispnet import MultiscaleObjective
from training.preset_kinds import ConfNetPreset, GradNetPreset, Preset, RegressorPreset
from training.presets import SMALL_CONFNET, SMALL_DISPNET, SMALL_GRADNET, STAGE_WEIGHTS, AugmentationConfig
from training.runs.request import TrainingRequest
from training.runs.train import train
from training.runs.weights import copy_weights, has_weights

FINEST_ONLY = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
EVEN = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
DILATIONS = {
    "dilations 1": (1, 1, 1, 1),
    "dilations 1, 2, 4, 4": (1, 2, 4, 4),
    "dilations 1, 2, 4, 8": (1, 2, 4, 8),
}


def _staged() -> dict[str, Any]:
    """The published schedule of loss weights, compressed: each stage but the last a tenth of the run."""
    return {"objective": MultiscaleObjective(STAGE_WEIGHTS, tuple(k / 10 for k in range(1, 7)))}


def regressors() -> dict[str, Preset]:
    base = SMALL_DISPNET
    network, optimizer = base.network, base.optimizer
    assert isinstance(network, DispNetConfig)

    def other_network(**changes: Any) -> RegressorPreset:
        return replace(base, network=replace(network, **changes))

    def other_optimizer(**changes: Any) -> RegressorPreset:
        return replace(base, optimizer=replace(optimizer, **changes))

    return {
        "base": base,
        "residual": other_network(residual=not network.residual),
        "no normalisation, rate 4e-4": replace(
            base,
            network=replace(network, normalization="none"),
            optimizer=replace(optimizer, learning_rate=4e-4),
        ),
        "predictions in px": other_network(prediction_scale=1.0),
        "two-sided correlation": other_network(one_sided=False),
        "rate 2e-3": other_optimizer(learning_rate=2e-3),
        "rate 5e-4": other_optimizer(learning_rate=5e-4),
        "no warm-up": other_optimizer(warmup_steps=0),
        "no clipping": other_optimizer(clip_norm=None),
        "published loss stages, compressed": replace(base, **_staged()),
        "all scales alike": replace(base, objective=MultiscaleObjective((EVEN,))),
        "finest scale only": replace(base, objective=MultiscaleObjective((FINEST_ONLY,))),
        "moving average 0.998": replace(base, ema_decay=0.998),
        "published augmentation": replace(base, augmentation=AugmentationConfig(horizontal_flip=0.5)),
        "no flips": replace(base, augmentation=replace(base.augmentation, horizontal_flip=0.0)),
        "width 0.375": other_network(width=0.375),
    }


def curricula() -> dict[str, Preset]:
    """On the graded set: the order of its frames ignored, or followed over a part of the run."""
    base = SMALL_DISPNET
    return {
        "graded, mixed": base,
        "graded, simple first, 0.3": replace(base, curriculum=0.3),
        "graded, simple first, 0.6": replace(base, curriculum=0.6),
    }


def heads(base: ConfNetPreset | GradNetPreset, dropouts: dict[str, float]) -> dict[str, Preset]:
    """What both heads are compared in; `dropouts` are further rows by their names."""
    changes: dict[str, dict[str, Any]] = {
        "full resolution": {"half_resolution": False},
        **{name: {"dropout": value} for name, value in dropouts.items()},
        "no normalisation": {"normalization": "none"},
        **{
            name: {"dilations": value} for name, value in DILATIONS.items() if value != base.network.dilations
        },
        "width 64": {"width": 64, "hidden": 128},
        "32 features": {"features": "decoded"},
    }
    rows = {name: replace(base, network=replace(base.network, **change)) for name, change in changes.items()}
    return {"base": base, **rows}


def confnets() -> dict[str, Preset]:
    base = SMALL_CONFNET
    return {
        **heads(base, {"dropout 0.5": 0.5, "no dropout": 0.0}),
        "no cost features": replace(base, network=replace(base.network, cost_features=False)),
        **{
            f"labels within {threshold:g} px": replace(base, correct_within_px=threshold)
            for threshold in (0.5, 2.0, 3.0)
        },
    }


def gradnets() -> dict[str, Preset]:
    base = SMALL_GRADNET
    return {
        **heads(base, {"dropout 0.2": 0.2}),
        "mask above 2 px": replace(base, gradient_threshold_px=2.0),
        "mask above 5 px": replace(base, gradient_threshold_px=5.0),
    }


GROUPS = {"regressor": regressors, "curriculum": curricula, "confnet": confnets, "gradnet": gradnets}


def run(task: str, name: str, preset: Preset, options: argparse.Namespace) -> None:
    folder = options.out / task / name.replace(" ", "_").replace(",", "")
    finished = folder / "ablation.json"
    if finished.exists():
        return
    on_regressor = task in ("confnet", "gradnet")
    steps = options.head_steps if on_regressor else options.steps
    preset = replace(preset, validation_interval=max(1, steps // 4))
    init = (options.regressor or options.out / "regressor" / "base") if on_regressor else None
    data = options.graded if task == "curriculum" else options.data
    began = time.perf_counter()
    request = TrainingRequest(
        task=task if on_regressor else "regressor",
        data=((data, 1.0),),
        out=folder,
        preset=preset,
        validation=(options.data,),
        init=init,
        steps=steps,
        seed=options.seed,
        device="cpu",
        resume=True,
    )
    summary = train(request)
    row = {
        "name": name,
        "steps": steps,
        "seconds": round(time.perf_counter() - began, 1),
        **summary.validation,
    }
    if task == "confnet" and init is not None and has_weights(init, "gradnet"):
        row |= judge(folder, init, options.data)
    finished.write_text(json.dumps(row, indent=2) + "\n", encoding="utf-8")
    print(task, row, flush=True)


def judge(run: Path, source: Path, data: Path) -> dict[str, float]:
    """Of a ConfNet on the validation frames, whatever it took as correct: areas under the sparsification curve, and the
    errors of the refinement with the other networks and the parameters of `source`."""
    copy_weights(source, run, "gradnet")
    predictors = open_predictors(run, "cpu")
    frames = [predictors.frame(sample) for sample in open_source(data).held_out_frames()]
    refined = measure(open_settings(None, source).ours, frames)

    def area(threshold: float) -> float:
        curves = (
            sparsification_curve(frame.disparity, frame.truth, frame.confidence, threshold, steps=AUC_STEPS)
            for frame in frames
        )
        return float(np.nanmean([curve.auc for curve in curves]))

    return {
        "auc at 1 px": area(1.0),
        "auc at 3 px": area(3.0),
        "refined epe": refined.epe,
        "refined bad1": refined.bad,
        "refined gradient": refined.gradient,
    }


def table(task: str, names: list[str], out: Path) -> str:
    """Markdown of the finished rows, in the order they are defined."""
    rows = []
    for name in names:
        file = out / task / name.replace(" ", "_").replace(",", "") / "ablation.json"
        if file.exists():
            rows.append(json.loads(file.read_text(encoding="utf-8")))
    if not rows:
        return f"{task}: nothing finished"
    figures = [key for key in rows[0] if key not in ("name", "steps")]
    lines = [
        f"| {task}, {rows[0]['steps']} steps | {' | '.join(figures)} |",
        "|---" * (len(figures) + 1) + "|",
    ]
    for row in rows:
        values = (f"{row[key]:.0f}" if key == "seconds" else f"{row[key]:.3f}" for key in figures)
        lines.append(f"| {row['name']} | {' | '.join(values)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path)
    parser.add_argument("--graded", type=Path, help="what the group curriculum trains on")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--regressor", type=Path, help="run folder the heads stand on")
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--head-steps", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=(), help="group or group:row")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    for task, presets in GROUPS.items():
        known = presets()
        if not options.table and (task != "curriculum" or options.graded):
            for name, preset in known.items():
                if not options.only or task in options.only or f"{task}:{name}" in options.only:
                    run(task, name, preset, options)
        print(f"\n{table(task, list(known), options.out)}")


if __name__ == "__main__":
    main()
