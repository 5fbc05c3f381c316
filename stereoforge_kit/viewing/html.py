"""Self-contained HTML pages: one base template, one style sheet, pictures as data URIs, nothing external.

A package with pages of its own keeps them in `<package>/templates/` as `name.html`, starts them with
`{% extends "base.html" %}` and may use the macros of `macros.html`; `render_page` finds both.
"""

from __future__ import annotations

import base64
import io
from typing import Any

import imageio.v3 as imageio
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from stereoforge_kit.viewing.pictures import Picture


def encoded(picture: Picture, jpeg_quality: int | None = None) -> bytes:
    """The bytes of a PNG file, or of a JPEG file of the given quality (1..100)."""
    buffer = io.BytesIO()
    if jpeg_quality is None:
        imageio.imwrite(buffer, picture, extension=".png")
    else:
        imageio.imwrite(buffer, picture, extension=".jpg", quality=jpeg_quality)
    return buffer.getvalue()


def data_uri(picture: Picture, jpeg_quality: int | None = None) -> str:
    """The picture as text for the `src` of an `<img>`: PNG, or JPEG where a quality (1..100) is given.

    Take PNG for masks, colour codes and anything whose single pixels matter, JPEG (85 or so) for photographs.
    """
    kind = "png" if jpeg_quality is None else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(encoded(picture, jpeg_quality)).decode()}"


def environment(package: str) -> Environment:
    """A jinja2 environment over `<package>/templates/` and the shared templates here; escapes by default."""
    shared = PackageLoader("stereoforge_kit.viewing")
    loader = (
        shared if package == "stereoforge_kit.viewing" else ChoiceLoader([PackageLoader(package), shared])
    )
    page_environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    page_environment.globals["data_uri"] = data_uri
    page_environment.globals["asset"] = lambda name: _asset(page_environment, name)
    return page_environment


def render_page(package: str, template: str, **context: Any) -> str:
    """Render `<package>/templates/<template>` with a context to one HTML document."""
    return environment(package).get_template(template).render(**context)


def _asset(page_environment: Environment, name: str) -> Markup:
    """The text of a style sheet or script of ours, unescaped, to be put inside the page."""
    source, _, _ = page_environment.loader.get_source(page_environment, name)  # type: ignore[union-attr]
    return Markup(source)
