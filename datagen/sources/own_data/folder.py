"""`folder:PATH`: a folder of pairs with disparities, found by common names (`datagen.sources.own_data.names`).

Views and disparities may lie in a folder each (`left/0001.png`), in a folder for each scene (`scene/im0.png`), or side
by side (`0001_L.png`). Disparities are of any format of `datagen.formats.disparity`; `,scale=100` behind the folder
says that a pixel is stored as 100. Folders called train, val and test are the splits. Without a val one, the last tenth
of what is trained on validates it. Pairs of one folder below the set's are of one scene where such folders tell them
apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from datagen.errors import DatasetError
from datagen.sources.own_data.names import Part, Role, pair_keys, parts_of
from datagen.sources.own_data.pairs import SCALE, PairFiles, reading_remarks, units_of
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrames, StereoFrame
from stereoforge_kit.files import walk_files
from stereoforge_kit.messages import listed, shortened

_EXPECTED = "left and right, image_2 and image_3, im0 and im1, or _L and _R"
_OPTIONAL: Mapping[Role, str] = {
    "disparity": "disparities",
    "disparity_right": "right disparities",
    "occlusion": "occlusion masks",
    "visible": "visibility masks",
    "valid": "validity masks",
}
_LONGEST_PATH = 60
_Files = dict[Role, PurePosixPath]


@dataclass(frozen=True)
class _Folder:
    """What was found in a folder."""

    root: Path
    pairs: dict[tuple[str, str], _Files]
    """The files of each pair by its split and key, in order."""

    @property
    def splits(self) -> tuple[str, ...]:
        return tuple(
            split for split in ("train", "val", "test") if any(split == found for found, _ in self.pairs)
        )

    def of(self, split: str) -> list[PairFiles]:
        """The pairs of a split with disparities; those of the whole folder if it has no splits."""
        chosen = {name: files for name, files in self.pairs.items() if name[0] in ("", split)}
        scenes = pair_keys([files["left"] for files in chosen.values()])
        return [
            PairFiles(
                name="/".join(filter(None, (found, key))) or self.root.name,
                scene_name=PurePosixPath(scene).parent.as_posix() if "/" in scene else scene,
                origin="",
                **{role: self.root / path for role, path in files.items()},
            )
            for ((found, key), files), scene in zip(chosen.items(), scenes, strict=True)
            if "disparity" in files
        ]


def _open(location: str) -> _Folder:
    """What a folder holds. Raises DatasetError for what cannot be told or does not go together."""
    root = Path(location)
    if not root.is_dir():
        raise DatasetError(f"{root}: is no folder")
    files = [PurePosixPath(path.relative_to(root).as_posix()) for path in walk_files(root)]
    try:
        parts = parts_of(files)
    except DatasetError as error:
        raise DatasetError(f"{root}: {error}") from error
    pairs = _grouped(root, parts)
    _check_whole(root, pairs)
    return _Folder(root, {name: files for name, files in sorted(pairs.items()) if "left" in files})


def _grouped(root: Path, parts: Mapping[PurePosixPath, Part]) -> dict[tuple[str, str], _Files]:
    pairs: dict[tuple[str, str], _Files] = {}
    for path, part in sorted(parts.items(), key=lambda item: not item[1].preferred):
        files = pairs.setdefault((part.split, part.key), {})
        if part.role in files:
            if part.preferred or not parts[files[part.role]].preferred:
                what = part.role.replace("disparity_right", "right disparity")
                one, two = map(_shown, (files[part.role], path))
                raise DatasetError(
                    f"{root}: {one} and {two} could both be the {what} of one pair; a list names the files (list:FILE)"
                )
            continue
        files[part.role] = path
    return pairs


def _check_whole(root: Path, pairs: Mapping[tuple[str, str], _Files]) -> None:
    lefts, rights = ({name for name, files in pairs.items() if role in files} for role in ("left", "right"))
    if not lefts or not rights:
        raise DatasetError(
            f"{root}: has {'no' if not lefts else len(lefts)} left and {'no' if not rights else len(rights)} right "
            f"pictures by names such as {_EXPECTED}; a list names the files (list:FILE)"
        )
    if odd := sorted(lefts ^ rights):
        files = pairs[odd[0]]
        alone = files["left"] if "left" in files else files["right"]
        raise DatasetError(
            f"{root}: {len(lefts)} left and {len(rights)} right pictures; {_shown(alone)} has no partner"
        )
    if "" in (splits := {split for split, _ in lefts}) and len(splits) > 1:
        raise DatasetError(
            f"{root}: some pairs are in folders of splits ({listed(sorted(splits - {''}))}), others are not"
        )
    for split in sorted({split for split, _ in pairs}):
        _check_ground_truth(root, {name: files for name, files in pairs.items() if name[0] == split})


def _check_ground_truth(root: Path, pairs: Mapping[tuple[str, str], _Files]) -> None:
    """Check that the disparities and masks of a split are of all its pairs, or of none."""
    whole = [files for files in pairs.values() if "left" in files]
    for role, what in _OPTIONAL.items():
        stray = next((files[role] for files in pairs.values() if role in files and "left" not in files), None)
        count = sum(role in files for files in pairs.values())
        if stray is not None:
            raise DatasetError(
                f"{root}: {count} {what} for {len(whole)} pairs; {_shown(stray)} is of none of them"
            )
        if 0 < count < len(whole):
            lacking = next(files["left"] for files in whole if role not in files)
            raise DatasetError(
                f"{root}: {count} {what} for {len(whole)} pairs; {_shown(lacking)} has none; a list "
                "names the pairs to take (list:FILE)"
            )


def _shown(path: PurePosixPath) -> str:
    return shortened(str(path), _LONGEST_PATH)


def _find(location: str, split: str, scale: str | None = None) -> Sequence[StereoFrame]:
    units = units_of(location, scale)
    return FileFrames(pair.frame(units) for pair in _open(location).of(split))


def _splits(location: str) -> tuple[str, ...]:
    return _open(location).splits


def _describe(location: str, scale: str | None = None) -> str:
    """One sentence: which files were taken for what, by the first pair's."""
    found = _open(location)
    first = next(iter(found.pairs.values()))
    names: dict[Role, str] = {"left": "left", "right": "right", **_OPTIONAL}
    shown = ", ".join(f"{names[role]} {shortened(str(first[role]), 40)}" for role in names if role in first)
    splits = (
        f" ({', '.join(f'{sum(split == each for split, _ in found.pairs)} {each}' for each in found.splits)})"
    )
    pairs = [pair for split in found.splits or ("",) for pair in found.of(split)]
    remarks = reading_remarks(pairs[0], units_of(location, scale)) if pairs else ""
    count = len(found.pairs)
    return f"{count} pair{'s' * (count != 1)}{splits if found.splits else ''}, matched as {shown}{remarks}"


FORMATS = (
    SourceFormat(
        "folder",
        "a folder of pairs",
        lambda _: False,
        _find,
        options=(SCALE,),
        find_splits=_splits,
        sets_aside=True,
        describe=_describe,
    ),
)
