"""Tables 1-6, their intervals and their files."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from refine.baselines.wmf import WMF
from refine.evaluation.archive import read_evaluation, write_evaluation
from refine.evaluation.bootstrap import bootstrap
from refine.evaluation.evaluate import EvaluationFrame, evaluate
from refine.evaluation.results import EvaluatedSet, results_csv, results_json
from refine.metrics import kitti_d1
from refine.registry import default_methods
from refine.report.paper_tables import paper_tables
from refine.report.published import PAPER, counterpart
from refine.report.table_files import tables_csv, tables_json, tables_latex, tables_markdown
from refine.report.write import ReportContext, write_report
from tests.refine.worlds import toy_frame

ROWS = default_methods(
    ("regressor", "gradnet", "wmf", "color", "grad", "ours_quadratic", "ours", "ours_conf_gt")
)


def frames(count: int = 10, per_scene: int = 2) -> list[EvaluationFrame]:
    return [replace(toy_frame(seed, 24, 40), scene=f"scene {seed // per_scene}") for seed in range(count)]


@pytest.fixture(scope="module")
def evaluated() -> EvaluatedSet:
    return EvaluatedSet("toys & co_1", evaluate(frames(), ROWS), "flying_things", "test")


@pytest.fixture(scope="module")
def kitti() -> EvaluatedSet:
    objects = np.zeros((24, 40), np.uint16)
    objects[6:18, 12:30] = 3
    return EvaluatedSet("cars", evaluate([replace(f, objects=objects) for f in frames(2)], ROWS), "kitti2015")


def test_intervals_are_of_whole_scenes_and_ratios_of_pairs(evaluated: EvaluatedSet) -> None:
    known = bootstrap(evaluated.evaluation, resamples=500, seed=3)
    assert known.scenes == 5
    # The same by a loop over drawn scenes and the pooled sums of their frames.
    rng = np.random.default_rng(3)
    draws = rng.multinomial(5, [1 / 5] * 5, size=500)
    scenes = [evaluated.evaluation.frames[2 * i : 2 * i + 2] for i in range(5)]
    values, ratios = [], []
    for draw in draws:
        drawn = [frame for scene, times in zip(scenes, draw, strict=True) for frame in scene * times]
        errors = {}
        for method in ("ours", "regressor"):
            regions = [frame.pools[method].regions["all"] for frame in drawn]
            errors[method] = sum(r.total_error for r in regions) / sum(r.pixels for r in regions)
        values.append(errors["ours"])
        ratios.append(errors["ours"] / errors["regressor"])
    expected = np.quantile(values, [0.025, 0.975])
    got = known.values["ours"]["epe_all"]
    assert (got.low, got.high) == pytest.approx(tuple(expected))
    got = known.ratios["ours"]["epe_all"]
    assert (got.low, got.high) == pytest.approx(tuple(np.quantile(ratios, [0.025, 0.975])))
    one = known.ratios["regressor"]["gradient_masked"]
    assert (one.low, one.high) == (1, 1)


def test_the_same_seed_gives_the_same_intervals_and_few_scenes_none(evaluated: EvaluatedSet) -> None:
    evaluation = evaluated.evaluation
    assert bootstrap(evaluation, seed=1) == bootstrap(evaluation, seed=1)
    assert bootstrap(evaluation, seed=1) != bootstrap(evaluation, seed=2)
    for count in (1, 4):
        few = bootstrap(evaluate(frames(count, per_scene=1), ROWS[:1]))
        assert math.isnan(few.values["regressor"]["epe_all"].low)


def test_fractions_add_up_to_the_scores(kitti: EvaluatedSet) -> None:
    for name, score in kitti.evaluation.scores.items():
        pools = [frame.pools[name].fractions() for frame in kitti.evaluation.frames]
        for measure in pools[0]:
            sums = sum(pool[measure] for pool in pools)
            with np.errstate(invalid="ignore"):
                expected = (sums[:, 0] / sums[:, 1]).sum()
            assert score.measures()[measure] == pytest.approx(expected, nan_ok=True)


def test_tables_hold_our_numbers_the_papers_and_both_ratios(evaluated: EvaluatedSet) -> None:
    tables = {table.number: table for table in paper_tables(evaluated)}
    assert list(tables) == [1, 2, 3, 4, 5]
    scores = evaluated.evaluation.scores
    second = {row.method: row.cells for row in tables[2].rows}
    assert list(second) == ["regressor", "wmf", "ours_quadratic", "ours"]
    bad_all = second["ours"][2]
    assert bad_all.value == scores["ours"].regions["all"].bad
    assert bad_all.ratio == bad_all.value / scores["regressor"].regions["all"].bad
    assert bad_all.interval.low <= bad_all.value <= bad_all.interval.high
    assert (bad_all.paper, bad_all.paper_ratio) == (0.2117, pytest.approx(21.17 / 23.48))
    assert second["ours_quadratic"][2].paper == 0.2117  # the paper's is quadratic
    gradnet = tables[1].rows[1].cells[0]
    assert (gradnet.value, gradnet.paper) == (scores["gradnet"].gradient_masked, 0.05)
    fifth = {row.method: row.cells for row in tables[5].rows}
    assert tables[5].counterpart == "FlyingThings3D validation"
    assert (fifth["color"][0].paper, fifth["ours"][3].paper) == (2.04, 14.3)
    assert math.isnan(fifth["ours"][3].ratio)
    bound = tables[3].rows[-1]
    assert (bound.method, bound.upper_bound) == ("ours_conf_gt", True)


class OwnMedian(WMF):
    name: ClassVar[str] = "own_median"
    label: ClassVar[str] = "A median of my own"


def test_methods_that_the_paper_does_not_have_end_the_tables_of_disparities() -> None:
    rows = (*default_methods(("regressor",)), OwnMedian(radius_px=2))
    evaluation = evaluate(frames(2), rows)
    tables = {table.number: table for table in paper_tables(EvaluatedSet("toys", evaluation, "kitti2015"))}
    assert list(tables) == [2, 4, 6]
    for table in tables.values():
        assert [row.label for row in table.rows if row.method] == ["Regressor", "A median of my own"]
    own = tables[2].rows[1].cells[3]
    assert own.value == evaluation.scores["own_median"].regions["all"].epe
    assert math.isnan(own.paper)


def test_kittis_table_tells_cars_from_the_rest(kitti: EvaluatedSet) -> None:
    sixth = paper_tables(kitti)[-1]
    assert sixth.number == 6
    ours = next(row for row in sixth.rows if row.method == "ours")
    panels = kitti.evaluation.first
    whole = [
        np.vstack(arrays)
        for arrays in zip(
            *((p.disparities["ours"], p.frame.truth, p.frame.objects) for p in panels), strict=True
        )
    ]
    rates = kitti_d1(*whole)
    assert [cell.value for cell in ours.cells] == pytest.approx(
        [rates.background, rates.foreground, rates.all]
    )
    assert [cell.paper for cell in ours.cells] == [0.0439, 0.0459, 0.0443]
    assert "Displets (paper)" in [row.label for row in sixth.rows]


@pytest.mark.parametrize(
    ("family", "split", "table", "expected"),
    [
        ("flying_things", "test", 2, "FlyingThings3D test"),
        ("flying_things", "val", 1, "FlyingThings3D validation"),
        ("flyingthings3d-final", "test", 5, "FlyingThings3D validation"),
        ("sintel", "test", 3, "Sintel"),
        ("kitti2015", "test", 6, "KITTI 2015"),
        ("my own", "test", 2, None),
    ],
)
def test_the_papers_counterpart_of_a_set(family: str, split: str, table: int, expected: str | None) -> None:
    assert counterpart(family, split, table) == expected
    assert expected is None or expected in PAPER


def test_every_file_holds_the_same_numbers(evaluated: EvaluatedSet, kitti: EvaluatedSet) -> None:
    tables = {each.name: paper_tables(each) for each in (evaluated, kitti)}
    rows = list(csv.DictReader(tables_csv(tables).splitlines()))
    records = json.loads(tables_json(tables))
    assert len(rows) == len(records) > 40
    for row, record in zip(rows, records, strict=True):
        assert row["measure"] == record["measure"]
        for name in ("value", "low", "high", "ratio", "paper", "paper_ratio"):
            assert (float(row[name]) if row[name] else None) == record[name]
    markdown, latex = tables_markdown(tables), tables_latex(tables)
    epe = evaluated.evaluation.scores["ours"].regions["all"].epe
    assert f"{epe:.2f} [" in markdown
    assert f"{epe:.2f} [" in latex
    widths = {line.count(" | ") for line in markdown.split("**Table 2")[1].split("\n\n")[1].splitlines()}
    assert len(widths) == 1
    assert r"toys \& co\_1" in latex
    assert latex.count(r"\begin{table}") == latex.count(r"\end{table}") == sum(map(len, tables.values()))
    for line in latex.splitlines():
        assert "%" not in line.replace(r"\%", "") or line.startswith("% needs")


def test_a_report_of_two_sets_has_a_block_and_figures_for_each(
    evaluated: EvaluatedSet, kitti: EvaluatedSet, tmp_path
) -> None:
    files = write_report([evaluated, kitti], tmp_path)
    page = files.html.read_text()
    assert all(f'id="set-{number}"' in page for number in (1, 2))
    assert 'id="table-overview"' in page
    assert {path.name for path in (files.figures / "toys-co_1").iterdir()} >= {
        "fig1-1.png",
        "fig4.svg",
        "fig5.svg",
        "fig6-1.png",
    }
    assert {path.name for path in (files.figures / "cars").iterdir()} >= {"fig7.svg", "fig8-1.png"}
    assert (files.figures / "cars" / "fig7.svg").read_text().startswith("<?xml")
    small = write_report([kitti], tmp_path / "compact", ReportContext(compact=True))
    assert not small.csv.exists()
    assert {path.name for path in (small.figures / "cars").glob("fig[68]*")} == set()
    with pytest.raises(ValueError, match="no two of one name"):
        write_report([evaluated, evaluated], tmp_path)


def test_an_evaluation_survives_its_archive(evaluated: EvaluatedSet, kitti: EvaluatedSet, tmp_path) -> None:
    for each in (evaluated, kitti):
        folder = tmp_path / each.family
        write_evaluation(folder, each)
        again = read_evaluation(folder)
        assert results_json([again], {}) == results_json([each], {})
        assert results_csv([again]) == results_csv([each])
        assert bootstrap(again.evaluation) == bootstrap(each.evaluation)
        assert again.is_kitti == each.is_kitti
        for old, new in zip(each.evaluation.worst, again.evaluation.worst, strict=True):
            np.testing.assert_array_equal(old.disparities["ours"], new.disparities["ours"])
            np.testing.assert_array_equal(old.frame.image, new.frame.image)


@pytest.mark.parametrize("victim", ["evaluation.json", "evaluation.npz"])
def test_a_damaged_archive_is_refused_by_name(evaluated: EvaluatedSet, tmp_path, victim: str) -> None:
    write_evaluation(tmp_path, evaluated)
    path = tmp_path / victim
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(ValueError, match=r"evaluation\.json: is not a whole evaluation"):
        read_evaluation(tmp_path)
