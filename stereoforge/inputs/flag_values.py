"""Parse the values of flags."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from stereoforge.errors import UsageError

if TYPE_CHECKING:
    from datagen.recipe.disparity_histogram import DisparityHistogram


_HOST = re.compile(r"://(?:[^/@]*@)?(?:\[[^]/]*\]|[^/:]*)$")
"""The end of a URL without a path and without a port."""


def shown(metavar: str, default: object = None, text: str | None = None) -> Any:
    """How a flag looks in --help: its value's name, the default where the field's own says nothing, and what it does
    where a docstring cannot say it."""
    return tyro.conf.arg(
        metavar=metavar, help_behavior_hint=None if default is None else f"(default: {default})", help=text
    )


def several(metavar: str) -> Any:
    """The same for a flag that takes one value or more and cannot do without."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint="(one or more)")


def parse_size(text: str, flag: str = "size") -> tuple[int, int]:
    """(width, height) of "960x540"; `flag` names the flag in errors."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if not match or 0 in (sizes := (int(match[1]), int(match[2]))):
        raise UsageError(f"--{flag} takes WIDTHxHEIGHT in pixels, such as 960x540, not {text!r}")
    return sizes


def parse_range(text: str, flag: str = "disparity-range") -> tuple[float, float]:
    """(low, high) of "5,120"; `flag` names the flag in errors."""
    match = re.fullmatch(r"(\d{1,5}(?:\.\d+)?),(\d{1,5}(?:\.\d+)?)", text)
    if not match or float(match[1]) >= float(match[2]):
        raise UsageError(f"--{flag} takes LOW,HIGH in pixels with LOW < HIGH, such as 5,120, not {text!r}")
    return float(match[1]), float(match[2])


def parse_histogram(text: str, flag: str = "disparity-histogram") -> DisparityHistogram:
    """The histogram of "2-20:30,20-60:50,60-120:20": ranges in pixels that follow one another, and their weights."""
    from datagen.recipe.disparity_histogram import DisparityHistogram

    bins = [
        re.fullmatch(r"(\d{1,5}(?:\.\d+)?)-(\d{1,5}(?:\.\d+)?):(\d{1,9}(?:\.\d+)?)", part.strip())
        for part in text.split(",")
    ]
    found = [tuple(map(float, match.groups())) for match in bins if match]
    follows = all(one[1] == two[0] for one, two in pairwise(found)) and all(
        low < high for low, high, _ in found
    )
    total = sum(weight for _, _, weight in found)
    if len(found) < len(bins) or not follows or not total:
        raise UsageError(
            f"--{flag} takes LOW-HIGH:WEIGHT, comma-separated, each LOW the HIGH before it, such as "
            f"2-20:30,20-60:50,60-120:20, not {text!r}"
        )
    edges = (found[0][0], *(high for _, high, _ in found))
    return DisparityHistogram(edges, tuple(weight / total for _, _, weight in found))


def parse_shard(text: str) -> tuple[int, int]:
    """(index, count) of "3/16"."""
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if not match or int(match[1]) >= int(match[2]):
        raise UsageError(f"--shard takes I/N with 0 <= I < N, such as 0/16, not {text!r}")
    return int(match[1]), int(match[2])


def parse_weighted_source(text: str) -> tuple[str, float]:
    """(source, weight) of "source" (weight 1) or "source:2.5"; a folder that has such a name wins."""
    from datagen.sources.registry import source_formats, with_home

    source, _, number = text.rpartition(":")
    prefix, _, location = text.partition(":")
    has_format = prefix in source_formats()
    # Neither the only word after a format nor the port of http://host:8080 is a weight.
    if not source or (has_format and source == prefix) or _HOST.search(source):
        return text, 1.0
    if any(Path(with_home(name)).exists() for name in (text, location if has_format else text)):
        return text, 1.0
    try:
        weight = float(number)
    except ValueError:
        return text, 1.0
    if not 0 < weight < float("inf"):
        raise UsageError(f"--data {text}: the weight must be positive, got {number}")
    return source, weight


def parse_counts(flag: str, text: str, names: tuple[str, ...]) -> dict[str, int]:
    """Numbers by name out of "train=100,val=5"."""
    counts = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        match = re.fullmatch(r"(\w+)=(\d{1,9})", part)
        if not match or match[1] not in names:
            raise UsageError(f"{flag} takes NAME=N, comma-separated, of {', '.join(names)}, not {part!r}")
        counts[match[1]] = int(match[2])
    return counts


def parse_methods(text: str) -> tuple[str, ...]:
    """Names of methods out of "ours,wmf"; empty for all there are."""
    from refine.registry import default_methods

    names = tuple(name.strip() for name in text.split(",") if name.strip())
    try:
        default_methods(names)
    except ValueError as error:
        raise UsageError(f"--methods: {error}") from error
    return names


def parse_disparity_formats(flag: str, text: str | None, besides: str) -> tuple[str, ...]:
    """Endings of disparity files, with their dots, out of "png,npy"; none for None.

    Args:
        flag: Names the flag in errors.
        text: The flag's value.
        besides: The ending that is written anyway.
    """
    if text is None:
        return ()
    from datagen.formats.disparity import disparity_formats

    there_are = {each.endings[0] for each in disparity_formats().values()} - {besides}
    endings = [f".{name.strip().lower().removeprefix('.')}" for name in text.split(",") if name.strip()]
    for ending in endings:
        if ending not in there_are:
            names = ", ".join(sorted(ending[1:] for ending in there_are))
            raise UsageError(
                f"{flag} takes names of formats, comma-separated, of {names}, not {ending[1:]!r}"
            )
    return tuple(dict.fromkeys(endings))


def check_disparity_scale(scale: float | None, flag: str, disparity: Path | None) -> None:
    """Raise UsageError for a --disparity-scale that is not positive, or without the flag that gives disparities."""
    if scale is None:
        return
    if not 0 < scale < float("inf"):
        raise UsageError(f"--disparity-scale must be positive, got {scale}")
    if disparity is None:
        raise UsageError(f"--disparity-scale goes with {flag}")


def check_max_disparity(pixels: int | None) -> None:
    """Raise UsageError for a --max-disparity that is not positive."""
    if pixels is not None and pixels < 1:
        raise UsageError(f"--max-disparity must be at least 1, got {pixels}")
