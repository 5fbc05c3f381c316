"""Evaluation of hand-made frames whose numbers can be worked out on paper."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from refine import MRFParameters, refine_disparity
from refine.evaluation.evaluate import EvaluationFrame, EvaluationOptions, evaluate
from refine.method import Method, MethodOutput
from refine.methods.gradnet import GradNet
from refine.methods.ours import Ours
from refine.methods.ours_conf_gt import OursConfGT
from refine.methods.regressor import Regressor
from refine.metrics import (
    bad_pixel_rate,
    end_point_error,
    forward_gradient,
    gradient_error,
    sparsification_curve,
)
from refine.mrf.posterior import posterior_deviation
from refine.registry import default_methods, known_methods
from tests.refine.worlds import toy_frame

MAIN_ROWS = default_methods(("regressor", "gradnet", "ours", "ours_conf_gt"))
FLAT = np.full((2, 3), 10.0, np.float32)


def flat_frame(
    name: str, errors: list[list[float]], occlusion: list[list[int]], **more: object
) -> EvaluationFrame:
    return EvaluationFrame(
        name=name,
        image=np.zeros((2, 3, 3), np.uint8),
        truth=FLAT,
        occlusion=np.array(occlusion, np.uint8),
        disparity=FLAT + np.array(errors, np.float32),
        **more,
    )


def test_numbers_worked_out_by_hand():
    first = flat_frame("a", [[0, 0, 2], [0, 0, 0]], [[0, 0, 1], [0, 0, 2]])
    second = flat_frame("b", [[4, 4, 4], [4, 4, 4]], [[0, 0, 0], [0, 0, 0]])
    evaluation = evaluate([first, second], [Regressor()])
    score = evaluation.scores["regressor"]
    assert score.regions["all"].bad == pytest.approx(7 / 12)
    assert score.regions["all"].epe == pytest.approx(26 / 12)
    assert score.regions["all"].pixels == 12
    assert score.regions["occ"].bad == pytest.approx(1 / 2)
    assert score.regions["occ"].epe == pytest.approx(1.0)
    assert score.regions["occ"].pixels == 2
    # Horizontal: one difference of 2 among 8; vertical: one of -2 among 6.
    assert score.gradient_masked == pytest.approx(2 / 8 + 2 / 6)
    assert score.gradient_all == pytest.approx(2 / 8 + 2 / 6)
    one, other = evaluation.frames
    assert one.initial_bad == pytest.approx(1 / 6)
    assert one.optimal_auc == pytest.approx(1 / 6 + 5 / 6 * math.log(5 / 6))
    assert other.initial_bad == 1
    assert math.isnan(other.methods["regressor"].regions["occ"].bad)


def test_a_discontinuity_counts_in_the_unmasked_gradient_error_only():
    truth = np.array([[10, 10, 20, 20]], np.float32).repeat(3, axis=0)
    frame = EvaluationFrame(
        "edge", np.zeros((3, 4, 3), np.uint8), truth, np.zeros((3, 4), np.uint8), np.full_like(truth, 10)
    )
    score = evaluate([frame], [Regressor()]).scores["regressor"]
    assert score.gradient_masked == pytest.approx(0)
    assert score.gradient_all == pytest.approx(10 / 3)


def test_every_row_agrees_with_the_metrics_on_the_whole():
    frames = [toy_frame(seed) for seed in range(3)]
    evaluation = evaluate(frames, MAIN_ROWS)
    assert list(evaluation.scores) == ["regressor", "gradnet", "ours", "ours_conf_gt"]
    refined = [refine_disparity(f.disparity, f.confidence, f.gradient, f.image) for f in frames]
    labels = [(np.abs(f.disparity - f.truth) <= 1).astype(float) for f in frames]
    bound = [
        refine_disparity(f.disparity, label, f.gradient, f.image)
        for f, label in zip(frames, labels, strict=True)
    ]
    truth = np.vstack([f.truth for f in frames])
    occluded = np.vstack([f.occlusion for f in frames]) > 0
    for name, results in (("ours", refined), ("ours_conf_gt", bound)):
        whole = np.vstack(results)
        score = evaluation.scores[name]
        assert score.regions["all"].bad == pytest.approx(bad_pixel_rate(whole, truth))
        assert score.regions["occ"].bad == pytest.approx(bad_pixel_rate(whole, truth, mask=occluded))
        assert score.regions["all"].epe == pytest.approx(end_point_error(whole, truth))
        assert score.regions["occ"].epe == pytest.approx(end_point_error(whole, truth, occluded))
        assert score.seconds > 0
    gradients = np.concatenate([f.gradient for f in frames])
    true_gradients = np.concatenate([forward_gradient(f.truth) for f in frames])
    gradnet = evaluation.scores["gradnet"]
    assert gradnet.gradient_all == pytest.approx(gradient_error(gradients, true_gradients))
    assert math.isnan(gradnet.regions["all"].bad)
    assert gradnet.gradient_masked < 0.05
    assert evaluation.scores["ours"].regions["all"].epe < evaluation.scores["regressor"].regions["all"].epe
    assert evaluation.upper_bounds == {"ours_conf_gt"}


def test_frames_are_read_one_at_a_time_and_progress_is_told():
    told: list[tuple[int, str]] = []
    alive = 0

    def frames():
        nonlocal alive
        for seed in range(4):
            assert len(told) == seed
            yield toy_frame(seed, 12, 16)

    evaluate(frames(), [Regressor()], progress=lambda done, name: told.append((done, name)))
    assert told == [(seed + 1, f"TEST/A/{seed:04d}/0006") for seed in range(4)]


def test_compiling_at_the_first_run_is_not_counted_as_a_method_s_time():
    runs = []

    class Compiled(Regressor):
        def run(self, frame):
            runs.append(frame.name)
            if len(runs) == 1:
                time.sleep(0.3)
            return MethodOutput(disparity=frame.disparity)

    evaluation = evaluate([toy_frame(seed, 12, 16) for seed in (0, 1)], [Compiled()])
    assert evaluation.scores["regressor"].seconds < 0.1
    assert len(runs) == 2


def test_methods_without_their_inputs_are_skipped_and_named():
    frame = replace(toy_frame(0, 12, 16), confidence=None)
    evaluation = evaluate([frame], MAIN_ROWS)
    assert list(evaluation.scores) == ["regressor", "gradnet", "ours_conf_gt"]
    assert evaluation.skipped == {"ours": "Ours needs a confidence, which the frames come without"}
    assert evaluation.judged == "regressor"
    assert evaluation.frames[0].curves == {}


def test_frames_must_agree_on_what_they_have():
    whole = toy_frame(0, 12, 16)
    with pytest.raises(ValueError, match="frame TEST/A/0001/0006 comes without predicted gradients"):
        evaluate([whole, replace(toy_frame(1, 12, 16), gradient=None)])


def test_nothing_to_do_is_an_error():
    with pytest.raises(ValueError, match="no frame"):
        evaluate([])
    bare = replace(toy_frame(0, 12, 16), gradient=None)
    with pytest.raises(ValueError, match="no method can run: GradNet needs predicted gradients"):
        evaluate([bare], [GradNet()])
    with pytest.raises(ValueError, match="evaluated once"):
        evaluate([bare], [Regressor(), Regressor()])


def test_missing_estimates_are_counted():
    frame = flat_frame("f", [[0, 0, float("nan")], [0, 0, 3]], [[0, 0, 1], [0, 0, 1]])
    regions = evaluate([frame], [Regressor()]).scores["regressor"].regions
    assert (regions["all"].pixels, regions["all"].missing, regions["all"].bad) == (6, 1, 2 / 6)
    assert (regions["occ"].epe, regions["all"].epe) == (3.0, pytest.approx(3 / 5))


def test_the_first_and_the_worst_frames_are_kept():
    frames = [
        flat_frame(str(error), [[error] * 3] * 2, [[0] * 3] * 2) for error in (0.5, 3.0, 1.0, 9.0, 2.0, 0.25)
    ]
    options = EvaluationOptions(first_panels=2, worst_panels=3)
    evaluation = evaluate(frames, [Regressor()], options)
    assert [panel.frame.name for panel in evaluation.first] == ["0.5", "3.0"]
    assert [panel.frame.name for panel in evaluation.worst] == ["9.0", "3.0", "2.0"]
    assert [panel.order for panel in evaluation.worst] == [3, 1, 4]


def test_one_frame_a_scene_is_shown_while_there_are_scenes():
    frames = [
        replace(flat_frame(f"{scene}{error}", [[error] * 3] * 2, [[0] * 3] * 2), scene=scene)
        for scene, error in (("a", 1.0), ("a", 9.0), ("a", 8.0), ("b", 2.0), ("b", 7.0), ("c", 0.5))
    ]
    few = evaluate(frames, [Regressor()], EvaluationOptions(first_panels=2, worst_panels=2))
    assert [panel.frame.name for panel in few.first] == ["a1.0", "b2.0"]
    assert [panel.frame.name for panel in few.worst] == ["a9.0", "b7.0"]
    many = evaluate(frames, [Regressor()], EvaluationOptions(first_panels=5, worst_panels=5))
    assert [panel.frame.name for panel in many.first] == ["a1.0", "a9.0", "a8.0", "b2.0", "c0.5"]
    assert [panel.frame.name for panel in many.worst] == ["a9.0", "b7.0", "c0.5"]


def test_other_confidences_are_compared():
    frame = toy_frame(0)
    error = np.abs(frame.disparity - frame.truth)
    frame = replace(frame, other_confidences={"oracle": -error, "contrary": error})
    aucs = evaluate([frame], [Regressor()]).frames[0].aucs
    assert list(aucs) == ["confnet", "oracle", "contrary", "random", "optimal"]
    assert aucs["optimal"] == pytest.approx(aucs["oracle"], abs=2e-3)
    assert aucs["oracle"] <= aucs["confnet"] < aucs["random"] < aucs["contrary"]


def test_the_posterior_is_judged_on_the_refined_disparity():
    """An area a test computes from the deviations by itself; the initial disparity's areas stay what they were."""
    frame = toy_frame(0, 30, 40)
    ours, samples = Ours(MRFParameters(alpha=5.0)), 8
    plain = evaluate([frame], [ours]).frames[0]
    sampled = evaluate([frame], [ours], EvaluationOptions(posterior_samples=samples)).frames[0]
    assert plain.refined_aucs == {}
    assert sampled.aucs == plain.aucs
    assert list(sampled.refined_aucs) == ["posterior", "confnet", "random", "optimal"]
    refined = ours.run(frame).disparity
    deviation = posterior_deviation(
        frame.disparity, frame.confidence, frame.gradient, frame.image, MRFParameters(alpha=5.0), samples
    )
    curve = sparsification_curve(refined, frame.truth, -deviation)
    assert sampled.refined_aucs["posterior"] == pytest.approx(curve.auc)
    bad = np.mean(np.abs(refined - frame.truth) > 1)
    assert sampled.refined_aucs["random"] == pytest.approx(bad)
    assert sampled.refined_aucs["optimal"] < sampled.refined_aucs["posterior"] < bad


def test_conf_gt_trusts_exactly_the_right_pixels(monkeypatch):
    seen = {}

    def spy(_: Ours, frame: EvaluationFrame) -> MethodOutput:
        seen["confidence"] = frame.confidence
        return MethodOutput(disparity=frame.disparity)

    monkeypatch.setattr(Ours, "run", spy)
    nan = float("nan")
    frame = flat_frame(
        "f", [[0, 1, 1.5], [-1, -2, nan]], [[0] * 3] * 2, gradient=np.zeros((2, 3, 2), np.float32)
    )
    OursConfGT().run(frame)
    np.testing.assert_array_equal(seen["confidence"], [[1, 1, 0], [1, 0, 0]])


def test_methods_are_found_in_their_folder():
    assert {"regressor", "gradnet", "ours", "ours_conf_gt"} <= set(known_methods())
    assert [method.name for method in default_methods(("ours", "regressor"))] == ["ours", "regressor"]
    with pytest.raises(ValueError, match=r"no method 'magic'; known are .*ours"):
        default_methods(("magic",))


def test_a_method_that_returns_nothing_is_an_error():
    @dataclass(frozen=True)
    class Empty(Method):
        name: ClassVar[str] = "empty"
        label: ClassVar[str] = "Empty"

        def run(self, frame: EvaluationFrame) -> MethodOutput:
            del frame
            return MethodOutput()

    with pytest.raises(ValueError, match="neither"):
        evaluate([toy_frame(0, 12, 16)], [Empty()])


def test_a_frame_checks_its_shapes():
    frame = toy_frame(0, 12, 16)
    with pytest.raises(ValueError, match=r"frame TEST/A/0000/0006: gradient has shape \(12, 16\)"):
        replace(frame, gradient=frame.truth)
    with pytest.raises(ValueError, match="confidence 'lrc'"):
        replace(frame, other_confidences={"lrc": frame.truth[:5]})
