"""Studies: the arithmetic of the gap, plans, jobs done once, and a whole small study of rendered worlds."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from refine.evaluation.evaluate import evaluate
from refine.evaluation.results import EvaluatedSet
from refine.registry import default_methods
from scenes import FAMILIES
from stereoforge.cli import main
from stereoforge.errors import CommandError, UsageError
from stereoforge.study import DomainPlan, StudyPlan, StudyResult, read_plan, run_study
from stereoforge.study.gap import Gap, gaps, summary
from stereoforge.study.jobs import Job, make_job, run_jobs
from stereoforge.study.plan import NETWORKS
from stereoforge_kit.files import alone
from tests.refine.worlds import toy_frame
from tests.stereoforge.pipelines.test_submission import kitti_set
from training.preset_kinds import Preset
from training.presets import find_preset

SIZE = (128, 64)
STEPS = {"regressor": 2, "regressor_f": 1, "confnet": 1, "gradnet": 1}


def tiny_presets() -> dict[str, Preset]:
    """Presets whose crops fit tiny frames."""
    return {
        task: replace(
            find_preset(task, "tiny", "dispnet"),
            crop_width=SIZE[0],
            crop_height=SIZE[1],
            batch_size=1,
            validation_interval=1,
            validation_samples=1,
        )
        for task in NETWORKS
    }


def tiny_plan(**changes: Any) -> StudyPlan:
    names = [name for name in ("flying_things", "driving") if name in FAMILIES]
    domain = DomainPlan(
        config={"frames": 1},
        scenes={"train": 1, "val": 1, "test": 2},
        curriculum_scenes=1,
        curriculum=0.5,
        steps=STEPS,
    )
    plan = StudyPlan(
        domains=dict.fromkeys(names, domain),
        train=tuple(names),
        test=tuple(names),
        size=SIZE,
        samples=1,
        preset="tiny",
        fine_tuning_steps=1,
        forest=True,
        methods=("regressor", "regressor_f", "gradnet", "ours", "ours_conf_gt"),
    )
    return replace(plan, **changes)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> StudyPlan:
    """Rendered worlds, and somebody's data set without splits."""
    cars = kitti_set(tmp_path_factory.mktemp("cars") / "kitti", testing=False)
    plan = tiny_plan()
    return replace(
        plan, domains={**plan.domains, "cars": DomainPlan(source=str(cars))}, test=(*plan.test, "cars")
    )


@pytest.fixture(scope="module")
def study(plan: StudyPlan, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, StudyResult]:
    out = tmp_path_factory.mktemp("study")
    return out, run_study(plan, out, presets=tiny_presets())


def evaluated(seed: int) -> EvaluatedSet:
    rows = default_methods(("regressor", "ours", "ours_conf_gt"))
    return EvaluatedSet(str(seed), evaluate([toy_frame(seed, 24, 32)], rows))


def test_shares_of_a_gap_worked_out_by_hand() -> None:
    gap = Gap("driving", "epe_all", cross=10, home=4, refined=8.5, true_confidence=7, fine_tuned=4)
    assert gap.size == 6
    assert gap.shares == {
        "refinement": 0.25,
        "refinement, true confidence": 0.5,
        "fine-tuning on the domain": 1.0,
    }
    assert all(share != share for share in replace(gap, home=11).shares.values())
    assert all(share != share for share in replace(gap, home=float("nan")).shares.values())


def test_gaps_and_summary_come_from_the_right_cells() -> None:
    cells = {("a", "a"): evaluated(0), ("a", "b"): evaluated(1), ("b", "b"): evaluated(2)}
    found = gaps("a", ("a", "b"), cells, {"b": evaluated(3)})
    assert [(gap.domain, gap.measure) for gap in found] == [
        ("b", "epe_all"),
        ("b", "bad_all"),
        ("b", "gradient_masked"),
    ]

    def epe(cell: EvaluatedSet, method: str) -> float:
        return cell.evaluation.scores[method].regions["all"].epe

    first = found[0]
    assert first.cross == epe(cells["a", "b"], "regressor")
    assert first.home == epe(cells["b", "b"], "regressor")
    assert first.refined == epe(cells["a", "b"], "ours")
    assert first.true_confidence == epe(cells["a", "b"], "ours_conf_gt")
    assert first.fine_tuned == epe(evaluated(3), "regressor")
    numbers = summary("a", ("a", "b"), cells)
    assert numbers["b"]["ours"]["epe"] == first.refined
    assert set(numbers["a"]["regressor"]) == {"bad1", "epe", "gradient"}
    assert 0 <= (numbers["a"]["regressor"]["bad1"] or -1) <= 1


def test_a_plan_survives_its_file(tmp_path: Path) -> None:
    plan = tiny_plan()
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump(plan.plain()))
    assert read_plan(path) == plan


def test_only_what_is_trained_on_grows_from_simple_to_complex(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = tiny_plan()
    assert plan.recipe("driving", ("train", "val")).curriculum_scenes == 1
    assert plan.recipe("driving", ("test",)).curriculum_scenes == 0
    assert plan.tuning_recipe("driving").curriculum_scenes == 0
    asked: list[Job] = []
    monkeypatch.setattr("stereoforge.study.run.run_jobs", asked.extend)
    with pytest.raises(ValueError, match="not a whole evaluation"):  # nothing was run
        run_study(plan, tmp_path)
    shares = {
        job.settings["task"]: job.settings["preset"]["curriculum"]
        for job in asked
        if "preset" in job.settings
    }
    assert shares == {"regressor": 0.5, "regressor_f": 0.0, "confnet": 0.0, "gradnet": 0.0}


def test_the_shipped_plan_can_be_rendered() -> None:
    plan = read_plan(Path(__file__).parents[3] / "recipes" / "study.yaml")
    for name in plan.test:
        recipe = plan.recipe(name, ("train", "test"))
        assert (recipe.world.width, recipe.world.height, recipe.seed) == (*plan.size, plan.seed)
        assert recipe.scenes["test"] * recipe.world.frames >= 100
    tuning = plan.tuning_recipe("flying_things")
    assert (dict(tuning.scenes), tuning.world.frames) == ({"val": plan.tuning_frames}, 1)
    assert plan.subject == "flying_things"
    assert plan.recipe("flying_things", ("train",)).scenes["train"] * 4 >= 1000


def test_the_shipped_gap_trains_alike_everywhere() -> None:
    plan = read_plan(Path(__file__).parents[3] / "recipes" / "study_gap.yaml")
    assert set(plan.train) == set(plan.test) == set(FAMILIES)
    assert len({tuple(domain.steps.items()) for domain in plan.domains.values()}) == 1
    assert len({tuple(domain.scenes.items()) for domain in plan.domains.values()}) == 1


@pytest.mark.parametrize("compared", [True, False])
def test_the_fine_tuned_rival_is_trained_only_to_be_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compared: bool
) -> None:
    asked: list[Job] = []
    monkeypatch.setattr("stereoforge.study.run.run_jobs", asked.extend)
    rows = ("regressor", "ours", *(("regressor_f",) if compared else ()))
    with pytest.raises(ValueError, match="not a whole evaluation"):  # nothing was run
        run_study(tiny_plan(methods=rows), tmp_path)
    assert sum("training the regressor_f" in job.title for job in asked) == compared


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"train": ()}, "at least one domain"),
        ({"test": ("nowhere",)}, "no domain 'nowhere'"),
        ({"domains": {"swimming": DomainPlan()}, "train": ("swimming",), "test": ("swimming",)}, "no family"),
        ({"methods": ("magic",)}, "no method 'magic'"),
        ({"tuning_frames": -1}, "must not be negative"),
        ({"domains": dict.fromkeys(FAMILIES, DomainPlan(curriculum=1.5))}, "to 1; got 0 and 1.5"),
        ({"domains": dict.fromkeys(FAMILIES, DomainPlan(curriculum_scenes=-1))}, "must not be negative"),
        ({"test": ("flying_things", "flying_things")}, "named twice"),
    ],
)
def test_plans_that_cannot_be_are_refused(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        tiny_plan(**changes)


def test_files_that_are_no_plans_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    with pytest.raises(UsageError, match="there is no plan"):
        read_plan(path)
    for text in ("[1, 2", "train: 3", "{}", "domains: {flying_things: {speed: 3}}\ntrain: [a]\ntest: [a]"):
        path.write_text(text)
        with pytest.raises(UsageError, match="plan"):
            read_plan(path)


def test_jobs_are_done_once_and_a_changed_setting_is_another_job(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done: list[str] = []

    def jobs(steps: int, broken: bool = False) -> list[Any]:
        def fail(_: Path) -> None:
            raise OSError("disk full")

        first = make_job(tmp_path, "first", "first", {"steps": steps}, 60, lambda _: done.append("first"))
        run = fail if broken else lambda _: done.append("second")
        return [first, make_job(tmp_path, "second", "second", {"of": first.key}, 120, run)]

    with pytest.raises(OSError, match="disk full"):
        run_jobs(jobs(1, broken=True))
    assert "step 1 of 2: first; about 3 min left" in capsys.readouterr().out.replace("\n", " ")
    run_jobs(jobs(1))
    assert done == ["first", "second"]
    run_jobs(jobs(1))
    assert done == ["first", "second"]
    run_jobs(jobs(2))
    assert done == ["first", "second"] * 2
    assert len(list(tmp_path.iterdir())) == 4


def test_the_same_frames_are_never_trained_and_tested_on(tmp_path: Path) -> None:
    cars = kitti_set(tmp_path / "kitti", testing=False)
    domains = {"cars": DomainPlan(source=str(cars))}
    with pytest.raises(UsageError, match="tested on what it was trained on"):
        run_study(tiny_plan(domains=domains, train=("cars",), test=("cars",)), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (("--train", "flying_things"), "one to test on"),
        (("--train", "flying_things", "--test", "driving", "--steps", "regresor=5"), "--steps takes NAME=N"),
        (("--train", "flying_things", "--test", "driving", "--scenes", "train=0"), "at least 1"),
        (("--plan", "plan.yaml", "--seed", "3"), "--plan says it all"),
        (("--plan", "plan.yaml"), "there is no plan"),
    ],
)
def test_wrong_flags_are_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: tuple[str, ...], complaint: str
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["study", "--out", str(tmp_path / "out"), *flags])
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_short_first_step_does_not_decide_about_hours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = iter([0.0, 0.0, 100.0])
    monkeypatch.setattr("stereoforge.study.jobs.time", SimpleNamespace(monotonic=lambda: next(clock)))
    first, second = (
        make_job(tmp_path, name, name, {}, guess, lambda _: None) for name, guess in (("a", 1), ("b", 7200))
    )
    run_jobs([first, second])  # the first took a hundred times as long as guessed
    assert "step 2 of 2: b; about 2 h 20 min left" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_a_study_leaves_what_it_promises(plan: StudyPlan, study: tuple[Path, StudyResult]) -> None:
    out, result = study
    names = plan.test
    assert set(result.cells) == {(a, b) for a in plan.train for b in names}
    # Nothing is trained on what has no training split of its own.
    assert not [path for path in (out / "networks").iterdir() if "cars" in path.name]
    assert {gap.domain for gap in result.gaps} == set(names[1:])
    numbers = json.loads((out / "results" / "summary.json").read_text())
    assert set(numbers) == set(names)
    for test in names:
        scores = result.cells[names[0], test].evaluation.scores
        assert set(numbers[test]) == set(scores)
        assert numbers[test]["ours"]["epe"] == scores["ours"].regions["all"].epe
        assert numbers[test]["gradnet"]["bad1"] is None
    rows = list(csv.DictReader((out / "results" / "matrix.csv").read_text().splitlines()))
    assert {(row["trained_on"], row["tested_on"]) for row in rows} == set(result.cells)
    page = result.report.read_text()
    assert "From domain to domain" in page
    assert "https://" not in page
    for name in ("tables.md", "tables.tex", "tables.csv", "plan.yaml", "gap.json", "figures/disparities.svg"):
        assert (out / "results" / name).stat().st_size > 0
    assert read_plan(out / "results" / "plan.yaml") == plan


def test_two_studies_do_not_share_a_folder(plan: StudyPlan, tmp_path: Path) -> None:
    with (
        alone(tmp_path / ".lock"),
        pytest.raises(CommandError, match="another process is at this study right now"),
    ):
        run_study(plan, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]


@pytest.mark.slow
def test_a_finished_study_does_nothing_again_and_a_change_redoes_what_it_touches(
    plan: StudyPlan, study: tuple[Path, StudyResult], capsys: pytest.CaptureFixture[str]
) -> None:
    out, _ = study
    kinds = ("data", "networks", "evaluations", "statistics", "runs")
    before = {path: path.stat().st_mtime_ns for kind in kinds for path in (out / kind).rglob("*")}
    results = (out / "results" / "summary.json").read_bytes()
    run_study(plan, out, presets=tiny_presets())
    assert {path: path.stat().st_mtime_ns for kind in kinds for path in (out / kind).rglob("*")} == before
    assert (out / "results" / "summary.json").read_bytes() == results
    capsys.readouterr()

    changed = {**STEPS, "confnet": 2}
    name = plan.subject
    domains = {key: replace(each, steps=changed) for key, each in tiny_plan().domains.items()}
    other = tiny_plan(domains=domains, train=(name,), test=(name,), fine_tuning_steps=0)
    run_study(other, out, presets=tiny_presets())
    added = {path.relative_to(out).parts[:2] for kind in kinds for path in (out / kind).rglob("*")} - {
        path.relative_to(out).parts[:2] for path in before
    }
    assert sorted(kind for kind, _ in added) == ["evaluations", "networks", "runs"]
