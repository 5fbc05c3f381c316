"""A page in a real browser: tables sort, curves answer a pointer, pictures compare, and a phone's width is enough."""

from __future__ import annotations

import html
from typing import Any

import numpy as np
import pytest

from stereoforge_kit.viewing.html import environment
from stereoforge_kit.viewing.plots import curves, hoverable
from tests.browser import CHROMIUM, run_browser

PHONE_PX = 400

PAGE = """
{% extends "base.html" %}{% from "macros.html" import compare, table %}
{% block content %}
{{ table(["name", "a long heading of a number", "a_name_without_a_gap_0123456789", "third", "fourth", "fifth"],
         rows, "", "numbers") }}
{{ plot }}
{{ compare(before, after, "before", "after") }}
{% endblock %}
"""
PROBE = """
<script>
window.onload = () => {
  const page = document.querySelector("iframe").contentDocument, view = page.defaultView;
  const names = () => [...page.querySelectorAll("#numbers tbody th")].map(cell => cell.textContent);
  const headings = [...page.querySelectorAll("#numbers thead th")];
  const overflowing = headings.filter(cell => cell.scrollWidth > cell.clientWidth + 1);
  const press = () => page.querySelectorAll("#numbers thead th")[1].click();
  const facts = { width: page.documentElement.scrollWidth, unsorted: names(), overflowing: overflowing.length };
  press(); facts.ascending = names();
  press(); facts.descending = names();
  const plot = page.querySelector(".plot"), box = plot.querySelector("svg").getBoundingClientRect();
  const note = plot.querySelector(".plot-note");
  facts.quiet = view.getComputedStyle(note).display;
  const [left, , width] = JSON.parse(plot.dataset.plot).box;
  plot.dispatchEvent(new view.PointerEvent("pointermove", {
    clientX: box.left + box.width * (left + width * SHARE), clientY: box.top + box.height / 2 }));
  facts.note = [...note.children].map(line => line.textContent);
  facts.shown = view.getComputedStyle(note).display;
  plot.dispatchEvent(new view.PointerEvent("pointerleave"));
  facts.left = view.getComputedStyle(note).display;
  const stage = page.querySelector(".compare-stage"), slider = stage.querySelector("input");
  slider.value = 20; slider.dispatchEvent(new view.Event("input"));
  const frame = document.querySelector("iframe"), scroller = page.querySelector(".table-scroll");
  facts.stuck = [400, 700].map(width => {
    frame.width = width;
    page.querySelector("table").style.width = "1200px";
    scroller.scrollLeft = 150;
    return page.querySelector("tbody th").getBoundingClientRect().left - scroller.getBoundingClientRect().left;
  });
  facts.scrolled = scroller.scrollLeft;
  facts.share = stage.style.getPropertyValue("--share");
  document.body.textContent = "FACTS" + JSON.stringify(facts) + "END";
};
</script>
"""


@pytest.fixture(scope="module")
def facts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the probe finds on a page of `PHONE_PX`, with the pointer at a quarter of a plot's x axis."""
    if CHROMIUM is None:
        pytest.skip("needs Chromium, which this machine has not")
    page_environment = environment("stereoforge_kit.viewing")
    x = np.linspace(0, 10, 11)
    figure = curves({"rising": (x, x * 2), "falling": (x, 10 - x)}, "x of it", "y")
    page = page_environment.from_string(PAGE).render(
        title="A page",
        rows=[
            ["b", {"text": "2", "value": "2"}, 1, 2, 3, 4],
            ["a", "10", 1, 2, 3, 4],
            ["c", "–", 1, 2, 3, 4],
        ],
        plot=hoverable(figure),
        before=np.zeros((60, 300, 3), np.uint8),
        after=np.full((60, 300, 3), 255, np.uint8),
    )
    low, high = figure.axes[0].get_xlim()
    probe = PROBE.replace("SHARE", str((2.6 - low) / (high - low)))
    folder = tmp_path_factory.mktemp("browser")
    frame = f'<iframe width="{PHONE_PX}" height="900" style="border:0" srcdoc="{html.escape(page)}"></iframe>'
    (folder / "probe.html").write_text(f"<!doctype html><body>{frame}{probe}</body>")
    address = (folder / "probe.html").as_uri()
    return run_browser(address, folder / "profile", "--window-size=800,1000")


def test_a_press_on_a_heading_sorts_by_value_and_nothing_comes_last(facts: dict[str, Any]) -> None:
    assert facts["unsorted"] == ["b", "a", "c"]
    assert facts["ascending"] == ["b", "a", "c"]
    assert facts["descending"] == ["a", "b", "c"]


def test_a_pointer_over_a_plot_reads_every_curve_there(facts: dict[str, Any]) -> None:
    assert facts["quiet"] == "none"
    assert facts["shown"] == "block"
    assert facts["note"] == ["x of it: 3", "rising: 6", "falling: 7"]
    assert facts["left"] == "none"


def test_a_long_name_stays_in_its_column(facts: dict[str, Any]) -> None:
    assert facts["overflowing"] == 0


def test_a_wide_table_scrolls_in_its_own_box_and_keeps_its_first_column(facts: dict[str, Any]) -> None:
    assert facts["scrolled"] == 150
    assert facts["stuck"] == [0, 0]


def test_the_handle_shows_more_of_one_picture(facts: dict[str, Any]) -> None:
    assert facts["share"] == "20%"


def test_a_phone_needs_no_sideways_scrolling_of_the_page(facts: dict[str, Any]) -> None:
    assert facts["width"] <= PHONE_PX
