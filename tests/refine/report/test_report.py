"""The report: whole, self-contained, and the same numbers in all three files."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import imageio.v3 as imageio
import numpy as np
import pytest

from refine.evaluation.evaluate import EvaluationOptions, evaluate
from refine.evaluation.results import EvaluatedSet
from refine.registry import default_methods
from refine.report.crop_selection import most_improved_boundary, worst_boundary
from refine.report.overview import overview_picture
from refine.report.write import ReportContext, write_report
from tests.refine.worlds import toy_frame

MAIN_ROWS = default_methods(("regressor", "gradnet", "ours", "ours_conf_gt"))
VOID = {"meta", "img", "input", "link", "br", "hr"}


class Page(HTMLParser):
    """Reads a page, insists that tags match, and keeps tables, pictures and references."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.pictures = 0
        self.tables: dict[str, list[list[str]]] = {}
        self.text = ""
        self._table = ""

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if "id" in values:
            self.ids.append(values["id"])
        self.references += [values[name] for name in ("src", "href", "action", "data") if values.get(name)]
        self.pictures += tag == "img"
        if tag == "table":
            self._table = values.get("id", "")
            self.tables[self._table] = []
        if self._table and tag == "tr":
            self.tables[self._table].append([])
        if self._table and tag == "td":
            self.tables[self._table][-1].append(values.get("data-value", ""))

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        if tag == "table":
            self._table = ""

    def handle_data(self, data):
        self.text += data
        if self._table and self.open[-1] == "th" and self.tables[self._table][-1:]:
            self.tables[self._table][-1].append(data)


@pytest.fixture(scope="module")
def evaluation():
    frames = [toy_frame(seed) for seed in range(6)]
    error = np.abs(frames[0].disparity - frames[0].truth)
    frames[0] = replace(frames[0], other_confidences={"lrc": -error})
    return evaluate(frames, MAIN_ROWS)


@pytest.fixture(scope="module")
def written(evaluation, tmp_path_factory):
    context = ReportContext(
        title="A <small> report",
        lead="Six toy frames.",
        facts={"Weights": "none & nothing", "Data": "toys"},
        limits=("These are toys.",),
    )
    sets = [EvaluatedSet("toys", evaluation, "flying_things")]
    return write_report(sets, tmp_path_factory.mktemp("report") / "deep" / "out", context)


@pytest.fixture(scope="module")
def page(written):
    parser = Page()
    parser.feed(written.html.read_text())
    parser.close()
    return parser


def test_the_page_is_well_formed_and_needs_nothing_from_outside(written, page):
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert page.pictures > 30
    assert all(reference.startswith(("data:image/", "#")) for reference in page.references)
    text = re.sub(r"data:image/[a-z]+;base64,[A-Za-z0-9+/=]+", "", written.html.read_text())
    assert not re.search(r"https?:|url\([^#]|@import|//[a-z]+\.[a-z]", text)


def test_what_the_context_says_is_on_the_page_and_escaped(written, page):
    assert "A <small> report" in page.text
    assert "A &lt;small&gt; report" in written.html.read_text()
    for text in ("Six toy frames.", "none & nothing", "These are toys."):
        assert text in page.text


def test_csv_json_and_page_hold_the_same_numbers(evaluation, written, page):
    rows = list(csv.DictReader(written.csv.read_text().splitlines()))
    document = json.loads(written.json.read_text())
    (whole,) = document["sets"]
    frames = {frame["name"]: frame for frame in whole["frames"]}
    assert len(rows) == 4 + 4 + 6 * (4 + 3) + 1
    for row in rows:
        place = frames[row["frame"]] if row["frame"] else whole
        numbers = place[f"{row['kind']}s"][row["name"]]
        for measure, value in row.items():
            if measure not in ("set", "frame", "kind", "name"):
                expected = numbers.get(measure)
                assert value == "" if expected is None else float(value) == expected
    pooled = {row["name"]: row for row in rows if not row["frame"] and row["kind"] == "method"}
    columns = ("bad_all", "epe_all", "bad_occ", "epe_occ", "gradient_masked", "gradient_all", "seconds")
    shown = {row[0]: row[1:] for row in page.tables["set-1-errors"][1:]}
    for name, label in evaluation.labels.items():
        assert shown[label] == [pooled[name][column] for column in columns]
    assert float(pooled["ours"]["bad_all"]) == evaluation.scores["ours"].regions["all"].bad
    assert whole["methods"]["gradnet"]["bad_all"] is None
    assert document["about"]["limits"] == ["These are toys."]
    mean_auc = np.mean([frame.aucs["confnet"] for frame in evaluation.frames])
    assert whole["confidences"]["confnet"]["auc"] == pytest.approx(mean_auc)


def test_frames_that_share_a_name_keep_their_own_numbers(tmp_path):
    frames = [toy_frame(seed) for seed in (0, 1)]
    evaluation = evaluate([frames[0], replace(frames[1], name=frames[0].name)], MAIN_ROWS)
    document = json.loads(write_report([EvaluatedSet("toys", evaluation)], tmp_path).json.read_text())
    errors = [frame["methods"]["ours"]["epe_all"] for frame in document["sets"][0]["frames"]]
    assert errors == [frame.methods["ours"].regions["all"].epe for frame in evaluation.frames]
    assert errors[0] != errors[1]


def test_frames_are_listed_and_failures_shown(evaluation, page):
    assert len(page.tables["set-1-frames"]) == 1 + 6
    for panel in (*evaluation.first, *evaluation.worst):
        assert panel.frame.name in page.text


def test_writing_again_replaces_and_leaves_no_litter(evaluation, written):
    before = written.json.read_text()
    write_report([EvaluatedSet("toys", evaluation)], written.html.parent, ReportContext(title="Second"))
    assert {path.name for path in written.html.parent.iterdir()} == {
        "report.html",
        "results.csv",
        "results.json",
        "tables.csv",
        "tables.json",
        "tables.md",
        "tables.tex",
        "figures",
    }
    assert json.loads(written.json.read_text())["about"]["title"] == "Second"
    assert before != written.json.read_text()


def test_a_report_of_one_frame_without_networks(tmp_path):
    frame = replace(toy_frame(0), confidence=None, gradient=None, truth=np.full((48, 80), 8.0, np.float32))
    frame.disparity[:12] = np.nan
    files = write_report([EvaluatedSet("one", evaluate([frame], MAIN_ROWS))], tmp_path)
    parser = Page()
    parser.feed(files.html.read_text())
    assert parser.open == []
    assert (
        "Not run: Ours needs a confidence and predicted gradients, which the frames come without."
        in parser.text
    )
    assert "Regressor gives no disparity at 25.0 % of the pixels" in parser.text


def bare(seed, **changes):
    """A frame of which only the disparity was predicted."""
    return replace(toy_frame(seed), confidence=None, gradient=None, **changes)


def test_nothing_about_confidence_without_one_and_no_comparison_of_one_method(tmp_path):
    evaluation = evaluate([bare(seed) for seed in range(3)], MAIN_ROWS)
    files = write_report([EvaluatedSet("toys", evaluation, "flying_things")], tmp_path)
    text = files.html.read_text()
    assert "<svg" not in text
    for word in ("ConfNet", "AUC", "parsification", "Table 1", "fter refinement", "Refined"):
        assert word not in text
    assert "Table 2" in text
    assert not list(files.figures.glob("*/*.svg"))


def test_a_frame_without_ground_truth_has_no_error_pictures(tmp_path):
    nothing = np.full((48, 80), np.nan, np.float32)
    frames = [replace(toy_frame(0), truth=nothing), toy_frame(1)]
    text = write_report([EvaluatedSet("toys", evaluate(frames, MAIN_ROWS))], tmp_path).html.read_text()
    first, second = text.split('<section class="panel">')[1:]
    assert "No ground truth, so no errors." in first
    assert "rror: red" not in first
    assert second.count("rror: red above 1 px (") == 2 * 2  # caption and alternative text
    assert "First frame, TEST/A/0001/0006" in text
    assert "nan" not in re.sub(r"data:image/[a-z]+;base64,[A-Za-z0-9+/=]+", "", text)
    assert imageio.imread(tmp_path / "figures" / "toys" / "fig6-1.png").ndim == 3


def test_the_overview_has_intervals_under_its_ratios(tmp_path, evaluation):
    sets = [EvaluatedSet(name, evaluation, "flying_things") for name in ("one", "two")]
    text = write_report(sets, tmp_path).html.read_text()
    ratio = re.search(
        r'id="table-overview".*?<td data-value="[^"]*">(\d\.\d\d)<small>(.*?)</small>', text, re.DOTALL
    )
    low, high = map(float, ratio[2].split("–"))
    assert low <= float(ratio[1]) <= high


def test_the_papers_ratios_stand_beside_ours_with_and_without_intervals(tmp_path, evaluation):
    """Each number's small lines: as many beside it as under it. One scene has no intervals."""
    small = r"<small>(.*?)</small>"
    for name, frames, lines in (("six", evaluation, 2), ("one", evaluate([toy_frame(0)], MAIN_ROWS), 1)):
        text = write_report([EvaluatedSet(name, frames, "flying_things")], tmp_path / name).html.read_text()
        row = re.search(r'id="[^"]*-table-2".*?>Ours</th>(.*?)</tr>', text, re.DOTALL)
        cells = [[line for line in re.findall(small, cell) if line] for cell in row[1].split("<td")[1:]]
        assert [len(cell) for cell in cells] == [lines] * 8, cells


def brute_force_window(score: np.ndarray, size: tuple[int, int]) -> tuple[slice, slice]:
    """The window of the largest sum, by trying all of them."""
    windows = [
        (slice(y, y + size[0]), slice(x, x + size[1]))
        for y in range(score.shape[0] - size[0] + 1)
        for x in range(score.shape[1] - size[1] + 1)
    ]
    return max(windows, key=lambda window: score[window].sum())


def test_crop_selection_finds_the_boundary_with_most_error_or_gain():
    frame = toy_frame(3)
    halo = np.abs(frame.disparity - frame.truth) > 3
    refined = frame.disparity.copy()
    refined[:, 40:] = frame.truth[:, 40:]
    size = (16, 20)
    worst = worst_boundary(refined, frame.truth, size)
    gain = most_improved_boundary(frame.disparity, refined, frame.truth, size)
    assert halo[worst].sum() >= 0.9 * halo[brute_force_window(halo[:, :40], size)].sum()
    assert worst[1].start < 40 <= gain[1].start + 1
    right_halo = halo & (np.arange(80) >= 40)
    assert halo[gain].sum() >= 0.9 * right_halo[brute_force_window(right_halo, size)].sum()


def test_crop_selection_stays_in_the_frame_and_needs_a_boundary():
    frame = toy_frame(3)
    assert worst_boundary(frame.disparity, np.full_like(frame.truth, 5), (16, 20)) is None
    whole = worst_boundary(frame.disparity, frame.truth, (500, 500))
    assert frame.truth[whole].shape == frame.truth.shape
    odd = worst_boundary(frame.disparity, frame.truth, (47, 79))
    assert frame.truth[odd].shape == (47, 79)


def test_the_overview_shows_four_pictures_of_the_pairs_shape():
    frame = toy_frame(0)
    picture = overview_picture(frame.image, frame.disparity, frame.confidence, frame.truth)
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    assert 1.3 < picture.shape[1] / picture.shape[0] < 2.2
    halves = np.array_split(picture[:, : picture.shape[1] // 2 * 2], 2, axis=1)
    cells = [cell for half in halves for cell in np.array_split(half[: half.shape[0] // 2 * 2], 2, axis=0)]
    assert all((cell != 255).mean() > 0.4 for cell in cells)
    deviation = np.abs(frame.disparity - frame.truth)
    taller = overview_picture(frame.image, frame.disparity, frame.confidence, frame.truth, deviation)
    assert taller.shape[0] == pytest.approx(1.5 * picture.shape[0], rel=0.02)
    assert (taller[picture.shape[0] :, : picture.shape[1] // 2] != 255).mean() > 0.4


def test_areas_of_the_refined_disparity_are_a_table_and_rows_of_their_own(tmp_path):
    frames = [toy_frame(seed, 24, 32) for seed in (0, 1)]
    sampled = evaluate(frames, MAIN_ROWS, EvaluationOptions(posterior_samples=4))
    files = write_report([EvaluatedSet("toys", sampled)], tmp_path)
    mean = np.mean([frame.refined_aucs["posterior"] for frame in sampled.frames])
    stored = json.loads(files.json.read_text())["sets"][0]["refined_confidences"]["posterior"]["auc"]
    assert stored == pytest.approx(mean)
    page = files.html.read_text()
    assert "Posterior deviation" in page
    assert "The same of the refined disparity" in page
    assert f"{mean:.4f}" in page
