"""How `make docs` builds the documentation site."""

import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))  # the packages of this checkout, whatever is installed

project = "StereoForge"
author = "The StereoForge maintainers"
project_copyright = "The StereoForge maintainers, Apache 2.0"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["pictures"]
myst_heading_anchors = 3
highlight_language = "none"  # of blocks that name none: they are of shell
# A path in single backticks is code, and a link where it names something on these pages.
default_role = "py:obj"

autoclass_content = "both"
autodoc_member_order = "bysource"
autodoc_inherit_docstrings = False  # torch's of forward says nothing of ours
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"ArrayLike": "numpy.typing.ArrayLike"}
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

# Inventories of other projects come from the network, so only `make docs INTERSPHINX=1` asks for them.
if os.environ.get("INTERSPHINX"):
    extensions.append("sphinx.ext.intersphinx")
    intersphinx_mapping = {
        "python": ("https://docs.python.org/3", None),
        "numpy": ("https://numpy.org/doc/stable", None),
        "torch": ("https://docs.pytorch.org/docs/stable", None),
        "trimesh": ("https://trimesh.org", None),
    }

html_theme = "pydata_sphinx_theme"
html_title = "StereoForge"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}


def read_as_prose(_app: Any, what: str, _name: str, _of: Any, _options: Any, lines: list[str]) -> None:
    """Keep what the docstrings mean as plain text from being taken for markup, before napoleon reads them.

    |x| is an absolute value here and a substitution in reStructuredText, where a word must not go on after a backtick
    either, as in `Scene`s. A colon in the first line of an attribute's docstring is punctuation here and ends a type
    for napoleon, so an empty comment becomes the first line.
    """
    for number, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            bars = re.sub(r"(`[^`]*`)|\|", lambda found: found[1] or r"\|", line)
            lines[number] = re.sub(r"(`[^`]+`)(?=\w)", r"\1\\ ", bars)
    if what in ("attribute", "data", "property"):
        lines[:0] = ["..", ""]


def name_type_aliases(_app: Any, _domain: str, _kind: str, content: nodes.Element) -> None:
    """Write an alias in a union by its name, where Sphinx prints the object that stands for it."""
    for text in list(content.findall(nodes.Text)):
        named = re.sub(r"TypeAliasForwardRef\('(.*?)'\)", r"\1", text)
        if named != text:
            text.parent.replace(text, nodes.Text(named))


def setup(app: Any) -> None:
    app.connect("autodoc-process-docstring", read_as_prose, priority=400)  # napoleon's is 500
    app.connect(
        "object-description-transform", name_type_aliases, priority=600
    )  # autodoc's types are in by then
