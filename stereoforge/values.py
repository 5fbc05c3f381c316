"""Reading the small languages of flag values."""

from __future__ import annotations

import re
from typing import Any

import tyro

from stereoforge.errors import UsageError


def shown(metavar: str, default: object = None) -> Any:
    """How a flag looks in --help: its value's name, and the default where the field's own says nothing."""
    return tyro.conf.arg(
        metavar=metavar, help_behavior_hint=None if default is None else f"(default: {default})"
    )


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) of "960x540"."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if not match or 0 in (sizes := (int(match[1]), int(match[2]))):
        raise UsageError(f"--size takes WIDTHxHEIGHT in pixels, such as 960x540, not {text!r}")
    return sizes


def parse_shard(text: str) -> tuple[int, int]:
    """(index, count) of "3/16"."""
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if not match or int(match[1]) >= int(match[2]):
        raise UsageError(f"--shard takes I/N with 0 <= I < N, such as 0/16, not {text!r}")
    return int(match[1]), int(match[2])
