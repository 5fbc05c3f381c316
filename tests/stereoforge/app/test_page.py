"""The page in a real browser, at a desk's and at a phone's width."""

from __future__ import annotations

import asyncio
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from fastapi.responses import HTMLResponse, Response
from fastapi.routing import APIRoute

from datagen.formats import read_pfm, write_png
from stereoforge import StereoRefiner
from stereoforge.app.server import listening_socket, page_server
from tests.browser import CHROMIUM, run_browser
from tests.stereoforge.test_refine_many import picture_pair

PROBE = Path(__file__).with_name("probe.js")
DESK_PX, PHONE_PX = 1280, 400
HEIGHT_PX = 3400
"""So that nothing has to be scrolled, and no scroll bar takes of the width."""
TIMEOUT_S = 600


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The page, served beside a probe that uses it in a frame and is loading until it is done."""
    if CHROMIUM is None:
        pytest.skip("needs Chromium, which this machine has not")
    folder = tmp_path_factory.mktemp("app")
    app = page_server(StereoRefiner(), folder)
    add_probe(app, material(folder / "material"))
    listening = listening_socket("127.0.0.1", 0)
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    while not server.started:
        time.sleep(0.1)
    yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    server.should_exit = True
    thread.join()
    listening.close()


def material(folder: Path) -> Path:
    """Pictures to drop."""
    left, right = picture_pair(1)
    write_png(folder / "left.png", left)
    write_png(folder / "right.png", right)
    write_png(folder / "small.png", right[:, :-8])
    (folder / "broken.png").write_bytes((folder / "left.png").read_bytes()[:200])
    return folder


def add_probe(app: FastAPI, folder: Path) -> None:
    """Serve the probe before the page, which answers every address."""
    done = asyncio.Event()

    async def probe(width: int) -> HTMLResponse:
        done.clear()
        script = PROBE.read_text().replace("ALL", "true" if width == DESK_PX else "false")
        frame = f'<iframe src="/" width="{width}" height="{HEIGHT_PX}" style="border:0"></iframe>'
        return HTMLResponse(
            f'<!doctype html><body style="margin:0">{frame}<img src="/held"><script>{script}</script>'
        )

    async def held() -> Response:
        await asyncio.wait_for(done.wait(), TIMEOUT_S)
        return Response(status_code=404)

    async def finish() -> None:
        done.set()

    async def file(name: str) -> Response:
        return Response((folder / name).read_bytes())

    routes = {"/probe": probe, "/held": held, "/done": finish, "/material/{name}": file}
    app.router.routes[:0] = [APIRoute(path, endpoint) for path, endpoint in routes.items()]


def visit(address: str, width: int, folder: Path) -> dict[str, Any]:
    window = f"--window-size={width},{HEIGHT_PX}"
    facts = run_browser(f"{address}/probe?width={width}", folder, window, timeout_s=TIMEOUT_S)
    assert "error" not in facts, facts
    return facts


@pytest.fixture(scope="module")
def desk(address: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a visitor meets who does everything."""
    return visit(address, DESK_PX, tmp_path_factory.mktemp("desk"))


@pytest.fixture(scope="module")
def phone(address: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What one meets who picks an example."""
    return visit(address, PHONE_PX, tmp_path_factory.mktemp("phone"))


def test_an_example_is_refined(desk: dict[str, Any]) -> None:
    assert desk["status"].startswith("640x360 pixels, disparity ")
    assert desk["pictures"] == [[640, 360]] * 2
    assert desk["leftOut"].startswith("points.ply: ")


def test_a_press_on_a_picture_reads_disparity_confidence_and_depth(desk: dict[str, Any]) -> None:
    assert desk["reading"].startswith(("x 319, y 1", "x 320, y 1"))
    assert all(word in desk["reading"] for word in ("disparity", "px", "confidence", "depth", " m"))


def test_a_download_is_the_disparity_on_the_page(desk: dict[str, Any], tmp_path: Path) -> None:
    names = [Path(urlsplit(address).path).name for address in desk["files"]]
    assert names == ["disparity.pfm", "disparity.png", "disparity.npy", "confidence.pfm", "points.ply"]
    for name, address in zip(names, desk["files"], strict=True):
        with urllib.request.urlopen(address) as answer:
            (tmp_path / name).write_bytes(answer.read())
    found = read_pfm(tmp_path / "disparity.pfm")
    assert found.shape == (360, 640)
    np.testing.assert_array_equal(found, np.load(tmp_path / "disparity.npy"))
    said = f"disparity {found.min():.1f} to {found.max():.1f} px"
    assert said in desk["status"]


def test_another_strength_refines_again(desk: dict[str, Any]) -> None:
    assert desk["strengthened"] != desk["status"]


def test_two_sizes_and_a_broken_picture_get_a_sentence(desk: dict[str, Any]) -> None:
    assert desk["sizes"].startswith(
        "The pictures differ in size: the left one has 128x64 pixels, the right one 120x64"
    )
    assert desk["broken"].startswith("broken.png: ")
    assert "/" not in desk["broken"]
    assert desk["sizesAlert"]
    assert desk["brokenAlert"]


def test_an_examples_calibration_is_none_of_dropped_pictures(desk: dict[str, Any]) -> None:
    """Its calibration would give wrong depths."""
    assert desk["droppedLeftOut"].startswith("Without a calibration")


def test_nothing_is_loaded_from_elsewhere(desk: dict[str, Any], address: str) -> None:
    assert len(desk["loaded"]) > 20
    assert [name for name in desk["loaded"] if not name.startswith((address, "blob:", "data:"))] == []


def test_no_label_is_cut_and_no_width_needs_sideways_scrolling(
    desk: dict[str, Any], phone: dict[str, Any]
) -> None:
    for facts, width in ((desk, DESK_PX), (phone, PHONE_PX)):
        assert facts["emptyWidth"] <= width
        assert facts["width"] <= width
        assert facts["cut"] == []
