"""Pages, plots and files."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import imageio.v3 as imageio
import numpy as np
import pytest

from stereoforge_kit.viewing import data_uri
from stereoforge_kit.viewing.html import environment
from stereoforge_kit.viewing.plots import curves, histogram, pixels, svg

PICTURE = np.random.default_rng(0).integers(0, 256, (6, 9, 3), np.uint8)


def decoded(uri: str) -> np.ndarray:
    kind, content = re.fullmatch(r"data:image/(png|jpeg);base64,(.*)", uri).groups()
    return imageio.imread(io.BytesIO(base64.b64decode(content)), extension=f".{kind}")


def test_a_png_uri_holds_the_picture_exactly():
    np.testing.assert_array_equal(decoded(data_uri(PICTURE)), PICTURE)


def test_a_jpeg_uri_holds_it_nearly():
    smooth = np.add.outer(np.arange(40), np.arange(60))[..., None] + np.array([10, 60, 110])
    found = decoded(data_uri(smooth.astype(np.uint8), jpeg_quality=90)).astype(int)
    assert np.abs(found - smooth).max() < 12


class Outline(HTMLParser):
    """The tags of a page in order, and whether they match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "img", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.tags if name == tag]


def page(content: str, **context: object) -> Outline:
    source = (
        '{% extends "base.html" %}{% from "macros.html" import figure, compare, blink, table %}'
        "{% block content %}" + content + "{% endblock %}"
    )
    return Outline(
        environment("stereoforge_kit.viewing").from_string(source).render(title="A & B", **context)
    )


def test_the_base_page_is_whole_and_asks_nothing_of_a_network():
    outline = page("<p>hello</p>")
    assert outline.open == []
    assert outline.named("html")[0]["lang"] == "en"
    assert not outline.named("link")
    assert all("src" not in attrs for attrs in outline.named("script"))
    assert {"name": "viewport", "content": "width=device-width, initial-scale=1"} in outline.named("meta")


def test_figures_carry_size_and_words():
    outline = page('{{ figure(picture, "left & right") }}', picture=PICTURE)
    (image,) = outline.named("img")
    assert (image["width"], image["height"], image["alt"]) == ("9", "6", "left & right")
    np.testing.assert_array_equal(decoded(image["src"]), PICTURE)


def test_comparisons_put_before_over_after():
    outline = page('{{ compare(a, b, "old", "new") }}', a=PICTURE, b=255 - PICTURE)
    after, before = outline.named("img")
    assert (before["alt"], after["alt"]) == ("old", "new")
    np.testing.assert_array_equal(decoded(before["src"]), PICTURE)
    assert outline.named("input")[0]["type"] == "range"
    assert outline.open == []


def test_tables_sort_by_value_where_given():
    rows = [["a", {"text": "1.0", "value": 1.04}], ["b", "2"]]
    outline = page('{{ table(["name", "number"], rows, "caption") }}', rows=rows)
    assert [cell.get("data-value") for cell in outline.named("td")] == ["1.04", None]
    assert outline.named("table")[0]["class"] == "sortable"


def test_a_missing_variable_is_an_error():
    with pytest.raises(Exception, match="nothing"):
        page("{{ nothing }}")


def test_plots_are_svg_in_the_ink_of_the_page():
    figure = curves(
        {"a": ([0, 1], [0, 2]), "b": ([0, 1], [1, 1])}, "x, px", "y", "Title", references=["b"], marker="o"
    )
    text = svg(figure)
    root = ElementTree.fromstring(text)
    assert root.tag == "svg"
    assert "http" not in text
    assert "currentColor" in text
    written = " ".join(node.text or "" for node in root.iter("text"))
    for word in ("x, px", "y", "Title", "a", "b"):
        assert word in written
    assert text == svg(figure)


def test_the_names_inside_two_plots_differ_and_lead_somewhere():
    texts = [svg(curves({"a": ([0, 1], [0, high])}, "x", "y", marker="o")) for high in (1, 2)]
    names = [set(re.findall(r'\bid="([^"]+)"', text)) for text in texts]
    for text, known in zip(texts, names, strict=True):
        assert known
        assert set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)) <= {
            pair for name in known for pair in ((name, ""), ("", name))
        }
    assert not names[0] & names[1]


def test_histograms_draw_every_series():
    picture = pixels(histogram([0, 1, 2], {"train": [1, 3], "test": [2, 2]}, "disparity, px", "share"))
    assert picture.dtype == np.uint8
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 10
