"""`list:FILE`: pairs with disparities that a list names (`datagen.sources.own_data.listing`).

Paths are relative to the list's folder, or to another one that `,root=DIR` behind the file states; no path leaves it.
Disparities are of any format of `datagen.formats.disparity`; `,scale=100` says that a pixel is stored as 100. A fourth
column is a mask of valid pixels, or what its name says: the right disparity, or an occlusion mask. A list has no
splits: of one that is trained on, the last tenth validates. Pairs whose left pictures lie in one folder are of one
scene where such folders tell pairs apart.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from datagen.errors import DatasetError
from datagen.sources.own_data.listing import ListLine, PairList, read_list
from datagen.sources.own_data.names import pair_keys
from datagen.sources.own_data.pairs import SCALE, PairFiles, reading_remarks, units_of
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrames, StereoFrame
from stereoforge_kit.messages import shortened

_ROOT = "root"
_LONGEST = 80


def _open(location: str, root: str | None) -> tuple[PairList, list[PairFiles]]:
    """A list's lines and the pairs they name. Raises DatasetError, naming the line, for what is wrong."""
    file = Path(location)
    if file.is_dir():
        raise DatasetError(
            f"{file}: is a folder, not a list; folder:{file} takes it by the names of its files"
        )
    listed = read_list(file)
    folder = Path(os.path.abspath(file.parent if root is None else root))  # noqa: PTH100 (Links stay as they are.)
    if not folder.is_dir():
        raise DatasetError(f"{file}: root={root} is no folder")
    pairs = [_pair(line, file, folder, stated=root is not None) for line in listed.lines]
    _check_names(file, listed, pairs)
    scenes = pair_keys([PurePosixPath(pair.left.relative_to(folder).as_posix()) for pair in pairs])
    named = (PurePosixPath(scene).parent.as_posix() if "/" in scene else scene for scene in scenes)
    return listed, [replace(pair, scene_name=scene) for pair, scene in zip(pairs, named, strict=True)]


def _pair(line: ListLine, file: Path, root: Path, stated: bool) -> PairFiles:
    where = f"{file.name}, line {line.number}"
    paths = {}
    for role, text in line.files.items():
        path = Path(os.path.normpath(root / text.replace("\\", "/")))
        if not path.is_relative_to(root):
            raise DatasetError(
                f"{file}: line {line.number} leaves {shortened(str(root), _LONGEST)} with {shortened(text, _LONGEST)}; "
                f"state the folder of all files (list:{file.name},root=DIR)"
            )
        if not path.is_file():
            hint = "" if stated else f"; if paths begin elsewhere, state where (list:{file.name},root=DIR)"
            raise DatasetError(
                f"{file}: line {line.number}: there is no file {shortened(str(path), _LONGEST)}{hint}"
            )
        paths[role] = path
    name = paths["left"].relative_to(root).with_suffix("").as_posix()
    return PairFiles(name=name, scene_name=name, origin=where, **paths)


def _check_names(file: Path, listed: PairList, pairs: Sequence[PairFiles]) -> None:
    first: dict[str, int] = {}
    for line, pair in zip(listed.lines, pairs, strict=True):
        if pair.name in first:
            raise DatasetError(
                f"{file}: line {line.number} names the left picture of line {first[pair.name]} again"
            )
        first[pair.name] = line.number


def _find(
    location: str,
    split: str,  # noqa: ARG001
    root: str | None = None,
    scale: str | None = None,
) -> Sequence[StereoFrame]:
    units = units_of(location, scale)
    return FileFrames(pair.frame(units) for pair in _open(location, root)[1])


def _describe(location: str, root: str | None = None, scale: str | None = None) -> str:
    """One sentence: which columns were taken for what, by the first line's files."""
    listed, pairs = _open(location, root)
    files = listed.lines[0].files
    shown = ", ".join(
        f"{role.replace('_', ' ')} {shortened(files[role], 40)}" for role in listed.columns if role in files
    )
    count = len(pairs)
    remarks = reading_remarks(pairs[0], units_of(location, scale))
    return f"{count} pair{'s' * (count != 1)}, columns of {listed.separator}: {shown}{remarks}"


FORMATS = (
    SourceFormat(
        "list",
        "a list of pairs",
        lambda _: False,
        _find,
        options=(_ROOT, SCALE),
        sets_aside=True,
        describe=_describe,
    ),
)
