"""The lines of a list of pairs, as trainers of stereo networks have them.

Every line names the files of one pair: left, right, disparity where there is one, and perhaps one more, in columns
that spaces, commas, semicolons or tabs separate. Names with separators in them stand in double quotes. Empty lines and
lines that begin with # are skipped. A first line of names (left, right, disp, ...) says what the columns are, in any
order, and columns of other names are left out.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from datagen.errors import DatasetError, FormatError
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from datagen.sources.own_data.names import Role, column_role, parts_of
from stereoforge_kit.messages import listed

_SEPARATORS = {"\t": "tabs", ",": "commas", ";": "semicolons", " ": "spaces"}
WITH_DISPARITY: tuple[Role, ...] = ("left", "right", "disparity")
"""What a line of a set with ground truth has."""
VIEWS: tuple[Role, ...] = ("left", "right")
"""What a line of pairs to be matched has."""


@dataclass(frozen=True)
class ListLine:
    """The files of one pair."""

    number: int
    """Of the line, from 1."""
    files: dict[Role, str]
    """As they are written."""


@dataclass(frozen=True)
class PairList:
    """A parsed list."""

    lines: tuple[ListLine, ...]
    columns: tuple[Role | None, ...]
    separator: str
    """In words."""


def read_list(file: Path, needed: tuple[Role, ...] = WITH_DISPARITY) -> PairList:
    """Read a list as `parse_list` parses it. Raises FormatError for a file that is no text in UTF-8."""
    try:
        text = read_bounded(file, MAX_JSON_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{file}: is no list, which is text in UTF-8") from error
    return parse_list(text, str(file), needed)


def parse_list(text: str, origin: str, needed: tuple[Role, ...] = WITH_DISPARITY) -> PairList:
    """Parse a list; `origin` names it in errors, and `needed` says what every line must have.

    Raises:
        DatasetError: an empty list, or a line that is none, with its number.

    >>> parse_list("# ours\\nl/1.png r/1.png d/1.pfm\\n", "a.txt").lines[0].files
    {'left': 'l/1.png', 'right': 'r/1.png', 'disparity': 'd/1.pfm'}
    """
    lines = [
        (number, line.strip(" \r"))
        for number, line in enumerate(text.split("\n"), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise DatasetError(f"{origin}: names no pair; each line needs {_listed(needed)}")
    separator = next((each for each in _SEPARATORS if each in lines[0][1]), " ")
    rows = [(number, _cells(line, separator, f"{origin}: line {number}")) for number, line in lines]
    columns = _header(rows[0][1])
    if columns is None:
        columns = _usual_columns(rows[0][1], f"{origin}: line {rows[0][0]}", needed)
    else:
        _check_header(columns, f"{origin}: line {rows[0][0]}", needed)
        rows = rows[1:]
        if not rows:
            raise DatasetError(f"{origin}: names no pair below its header")
    parsed = tuple(_line(number, cells, columns, origin, needed) for number, cells in rows)
    return PairList(parsed, columns, _SEPARATORS[separator])


def _cells(line: str, separator: str, where: str) -> list[str]:
    try:
        (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
    except (csv.Error, ValueError) as error:
        raise DatasetError(f"{where} cannot be split into columns ({error})") from error
    return [cell.strip() for cell in cells]


def _header(cells: list[str]) -> tuple[Role | None, ...] | None:
    """What the columns of a first line are, or None if it is no header: it names files, or no left and right column."""
    roles = tuple(map(column_role, cells))
    names_files = any(PurePosixPath(cell).suffix or "/" in cell or "\\" in cell for cell in cells)
    return None if names_files or not {"left", "right"} <= set(roles) else roles


def _check_header(columns: tuple[Role | None, ...], where: str, needed: tuple[Role, ...]) -> None:
    known = [role for role in columns if role is not None]
    twice = next((role for role in known if known.count(role) > 1), None)
    if twice is not None:
        raise DatasetError(f"{where} names two columns that could be {twice}")
    if "disparity" in needed and "disparity" not in known:
        raise DatasetError(f"{where} names no column of disparities (disp, disparity, gt)")


def _usual_columns(cells: list[str], where: str, needed: tuple[Role, ...]) -> tuple[Role | None, ...]:
    if len(needed) <= len(cells) <= len(WITH_DISPARITY):
        return WITH_DISPARITY[: len(cells)]
    if len(cells) == len(WITH_DISPARITY) + 1:
        return (*WITH_DISPARITY, _fourth(cells[-1]))
    raise DatasetError(
        f"{where} has {_columns(len(cells))} ({listed(cells, separator=' ')}); {_listed(needed)} are "
        "needed, then perhaps a mask, or a header that names the columns"
    )


def _listed(needed: tuple[Role, ...]) -> str:
    return f"{', '.join(needed[:-1])} and {needed[-1]}"


def _fourth(cell: str) -> Role:
    """What a fourth column without a name is: by its words a disparity or what is occluded, else what is valid."""
    path = PurePosixPath(cell.replace("\\", "/"))
    part = parts_of([path]).get(path)
    if part is not None and part.role in ("disparity", "disparity_right"):
        return "disparity_right"
    return part.role if part is not None and part.role in ("occlusion", "visible") else "valid"


def _line(
    number: int,
    cells: list[str],
    columns: tuple[Role | None, ...],
    origin: str,
    needed: tuple[Role, ...],
) -> ListLine:
    if len(cells) != len(columns):
        raise DatasetError(
            f"{origin}: line {number} has {_columns(len(cells))} where there should be {len(columns)} "
            f"({listed(cells, separator=' ')})"
        )
    files = {role: cell for role, cell in zip(columns, cells, strict=True) if role is not None and cell}
    lacking = next((role for role in needed if role not in files), None)
    if lacking is not None:
        raise DatasetError(f"{origin}: line {number} has no {lacking}")
    return ListLine(number, files)


def _columns(count: int) -> str:
    return "1 column" if count == 1 else f"{count} columns"
