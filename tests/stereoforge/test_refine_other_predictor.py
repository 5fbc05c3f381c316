"""`stereoforge refine` on a disparity that none of the networks made."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from datagen.formats import read_pfm, read_png, write_pfm, write_png
from refine.report.overview import overview_picture
from stereoforge.cli import main
from stereoforge_kit.matching import seem_swapped
from tests.training.synthetic import random_pair
from training.networks import ConfNet, GradNet
from training.preset_kinds import RegressorFreeConfNetPreset, RegressorFreeGradNetPreset
from training.presets import find_preset
from training.runs.weights import TrainingSummary, save_weights


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """left.png, right.png and the truth of a pair; given.pfm, given.png: the truth spoilt, with holes."""
    folder = tmp_path_factory.mktemp("pair")
    pair = random_pair(np.random.default_rng(2), 64, 128)
    write_png(folder / "left.png", pair.left)
    write_png(folder / "right.png", pair.right)
    given = pair.disparity_left + np.random.default_rng(0).normal(0, 0.5, (64, 128)).astype(np.float32)
    given[20:30, 40:60] = np.inf
    given[40:50, 90:110] += 9
    write_pfm(folder / "given.pfm", given)
    write_png(folder / "given.png", np.where(np.isfinite(given), given.clip(0) * 256, 0).astype(np.uint16))
    cv2.imwrite(str(folder / "given.tiff"), given * np.float32(100))
    write_pfm(folder / "given_right.pfm", pair.disparity_right)
    return folder, pair.disparity_left


def refine(folder: Path, out: Path, *more: str | Path, code: int = 0) -> None:
    with pytest.raises(SystemExit) as end:
        main([str(a) for a in ("refine", folder / "left.png", folder / "right.png", "--out", out, *more)])
    assert int(end.value.code or 0) == code


def test_the_deviation_is_a_file_and_leaves_the_disparity_alone(world, tmp_path):
    folder, _ = world
    words = ("--disparity", folder / "given.pfm")
    refine(folder, tmp_path / "plain", *words)
    refine(folder, tmp_path / "more", *words, "--deviation")
    assert not (tmp_path / "plain" / "deviation.pfm").exists()
    deviation = read_pfm(tmp_path / "more" / "deviation.pfm")
    assert deviation.shape == (64, 128)
    assert (deviation > 0).all()
    assert deviation[22:28, 45:55].mean() > 1.2 * np.median(deviation)  # the hole
    same = (read_pfm(tmp_path / name / "disparity.pfm") for name in ("plain", "more"))
    np.testing.assert_array_equal(*same)


@pytest.mark.parametrize(
    "source",
    [
        ("--disparity", "given.pfm"),
        ("--disparity", "given.png"),
        ("--disparity", "given.tiff", "--disparity-scale", "100"),
        ("--disparity", "given.pfm", "--disparity-right", "given_right.pfm"),
        ("--predictor", "sgbm"),
    ],
)
def test_a_foreign_disparity_gets_better_without_any_network(world, tmp_path, source, capsys):
    folder, truth = world
    empty = tmp_path / "run"
    empty.mkdir()
    flags = [folder / word if "given" in word else word for word in source]
    refine(folder, tmp_path / "r", *flags, "--weights", empty)
    said = " ".join(capsys.readouterr().out.split())
    assert "has none), confidence is taken from" in said
    assert "has none), slopes are taken from" in said
    refined, initial = (
        read_pfm(tmp_path / "r" / name) for name in ("disparity.pfm", "disparity_initial.pfm")
    )
    assert np.isfinite(refined).all()
    assert np.isfinite(initial).all()
    if "--disparity" in source:
        holes = np.isinf(read_pfm(folder / "given.pfm"))
        assert (read_pfm(tmp_path / "r" / "confidence.pfm")[holes] == 0).all()
        np.testing.assert_allclose(initial[~holes], read_pfm(folder / "given.pfm")[~holes], atol=1 / 256)
    assert np.abs(refined - truth).mean() < np.abs(initial - truth).mean()
    assert {path.name for path in (tmp_path / "r").iterdir()} >= {"gradient.exr", "overview.png"}


def test_a_scale_is_positive_and_of_a_disparity(world, tmp_path, capsys):
    folder, _ = world
    for words, reason in (
        (("--disparity", folder / "given.pfm", "--disparity-scale", "0"), "must be positive, got 0.0"),
        (("--disparity-scale", "256"), "--disparity-scale goes with --disparity"),
    ):
        refine(folder, tmp_path / "r", *words, code=2)
        assert reason in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "r").exists()


def test_a_disparity_of_the_wrong_sign_or_unit_and_swapped_views_are_doubted(world, tmp_path, capsys):
    folder, truth = world
    for name, wrong, doubt in (
        ("negative", np.where(np.arange(128) < 4, truth, -truth), "so the sign is turned"),
        ("normalised", truth / 128, "is it in pixels?"),
    ):
        write_pfm(tmp_path / f"{name}.pfm", wrong.astype(np.float32))
        refine(folder, tmp_path / name, "--disparity", tmp_path / f"{name}.pfm")
        assert doubt in " ".join(capsys.readouterr().out.split())
    refine(folder, tmp_path / "right", "--disparity", folder / "given.pfm")
    said = " ".join(capsys.readouterr().out.split())
    assert "is known" not in said
    assert "is it in pixels" not in said
    assert "other way round" not in said
    assert "negative" not in said
    swapped = ("refine", folder / "right.png", folder / "left.png", "--out", tmp_path / "swapped")
    with pytest.raises(SystemExit):
        main([str(word) for word in swapped])
    assert "can be matched the other way round" in " ".join(capsys.readouterr().out.split())


def test_the_run_folders_networks_judge_it(world, tmp_path, capsys):
    """With both networks in the run folder nothing is done by hand, and the confidence is the network's."""
    folder, _ = world
    run = tmp_path / "run"
    summary = TrainingSummary("custom", 1, 0, (("data", 1.0),), best_step=0)
    confnet, gradnet = find_preset("confnet_free", "tiny"), find_preset("gradnet_free", "tiny")
    assert isinstance(confnet, RegressorFreeConfNetPreset)
    assert isinstance(gradnet, RegressorFreeGradNetPreset)
    save_weights(run, "confnet_free", ConfNet(confnet.network), summary)
    given = ("--disparity", folder / "given.pfm", "--weights", run)
    refine(folder, tmp_path / "part", *given)
    said = capsys.readouterr().out
    assert "confnet_free" not in said
    assert "without a gradnet_free" in said
    save_weights(run, "gradnet_free", GradNet(gradnet.network), summary)
    refine(folder, tmp_path / "whole", *given)
    assert "without" not in capsys.readouterr().out
    confidence = [read_pfm(tmp_path / name / "confidence.pfm") for name in ("part", "whole")]
    np.testing.assert_array_equal(*confidence)
    assert np.isfinite(read_pfm(tmp_path / "whole" / "disparity.pfm")).all()


def test_contradictions_and_mistakes_are_sentences(world, tmp_path, capsys):
    folder, _ = world
    given = ("--disparity", folder / "given.pfm")
    for code, more, reason in (
        (2, (*given, "--predictor", "sgbm"), "choose one"),
        (2, ("--disparity-right", folder / "given.pfm"), "goes with --disparity"),
        (1, ("--disparity", folder / "left.png"), "left.png: a disparity is a 16-bit grey PNG"),
        (1, (*given, "--weights", tmp_path / "gone"), "no such run folder"),
        (1, (*given, "--weights", folder / "given.pfm"), "is a file, not a run folder"),
        (1, (*given, "--parameters", tmp_path / "gone.json"), "gone.json: cannot be read"),
    ):
        refine(folder, tmp_path / "r", *more, code=code)
        assert reason in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize("shape", [(400, 1), (1, 400)])
def test_narrow_pictures_take_no_longer_than_others(shape, tmp_path):
    """A column of pixels was scaled to the width of other pictures, and its overview had 376,530 rows."""
    rng = np.random.default_rng(0)
    for name in ("left.png", "right.png"):
        write_png(tmp_path / name, rng.integers(0, 256, (*shape, 3), np.uint8))
    assert not seem_swapped(*(read_png(tmp_path / name) for name in ("left.png", "right.png")))
    image = overview_picture(read_png(tmp_path / "left.png"), *[np.ones(shape)] * 3)
    assert max(image.shape) < 20_000


def test_the_same_picture_twice_is_doubted(world, tmp_path, capsys):
    folder, _ = world
    shutil.copy(folder / "left.png", tmp_path / "left.png")
    shutil.copy(folder / "left.png", tmp_path / "right.png")
    refine(tmp_path, tmp_path / "r", "--disparity", folder / "given.pfm")
    said = " ".join(capsys.readouterr().out.split())
    assert "both pictures are the same" in said


@pytest.mark.parametrize("sentinel", [65535.0, 1e30])
def test_sentinels_leave_the_good_pixels_alone(world, tmp_path, sentinel, capsys):
    folder, _ = world
    given = read_pfm(folder / "given.pfm")
    clean, spoilt = given.copy(), given.copy()
    clean[:, -10:], spoilt[:, -10:] = np.inf, sentinel
    write_pfm(tmp_path / "clean.pfm", clean)
    write_pfm(tmp_path / "spoilt.pfm", spoilt)
    for name in ("clean", "spoilt"):
        refine(folder, tmp_path / name, "--disparity", tmp_path / f"{name}.pfm")
    assert "larger than the picture is wide" in " ".join(capsys.readouterr().out.split())
    same = (read_pfm(tmp_path / name / "disparity.pfm") for name in ("clean", "spoilt"))
    np.testing.assert_array_equal(*same)
