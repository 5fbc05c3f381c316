"""The Markdown pages that people read, and what is in them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


def blocks(page: Path, language: str = "") -> list[str]:
    """The page's fenced code blocks of one language, in their order; "" for those that name none."""
    text = page.read_text(encoding="utf-8")
    return [
        body
        for kind, body in re.findall(r"^```(.*?)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        if kind == language
    ]


def name_of(page: Path) -> str:
    """What a test that failed calls the page."""
    return page.relative_to(ROOT).as_posix()
