"""What a file of a stereo set is, by the words in its path.

A path is read as words: `train/left_images/0001.png` is train, left, images, 0001. Some words say which view a file is
of, some what it holds, some that it is of a split, and some nothing (image, rgb, data). What is left tells which files
belong together: here `0001`. Views may be numbered instead, as in `image_2` and `image_3`; such names count only where
both of a pair are there and no file says left or right.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Literal

from datagen.errors import DatasetError

Role = Literal["left", "right", "disparity", "disparity_right", "occlusion", "visible", "valid"]
"""`occlusion` is a mask of what the right view does not show, `visible` one of what it shows, `valid` of what has a
disparity."""

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".ppm", ".pgm")
_NUMBERS_ONLY = (".pfm", ".npy", ".npz", ".exr")
"""Endings of what can be a disparity and no picture."""
_SPLITS = {
    "train": "train", "training": "train", "trainset": "train",
    "val": "val", "valid": "val", "validation": "val", "dev": "val",
    "test": "test", "testing": "test", "testset": "test",
}  # fmt: skip
_VIEWS: dict[str, Literal["left", "right"]] = {"left": "left", "l": "left", "right": "right", "r": "right"}
_ONE_WORD = re.compile(
    r"(left|right)(images?|imgs?|views?|disp|disparity)$|(images?|imgs?|im|disp|disparity|view)(l|r|left|right)$"
)
"""Words that are written as one, such as `imgL` in small letters."""
_DISPARITY = {"disp", "disps", "disparity", "disparities", "dispmap", "dispmaps"}
_TRUTH = {"gt", "groundtruth", "truth"}
_OCCLUDED = {"occ", "occl", "occlusion", "occlusions", "occluded"}
_VISIBLE = {"noc", "nocc", "nonocc"}
_VALID = {"valid", "validity", "mask", "masks"}
_OTHER = {
    "depth", "depths", "flow", "normal", "normals", "segmentation", "semantic", "semantics", "instance", "instances",
    "confidence", "calib", "calibration", "outofframe", "gradient", "index", "obj", "slanted", "uncertainty",
}  # fmt: skip
"""What is neither a picture nor a part of the ground truth here."""
_SAY_NOTHING = {
    "image", "images", "img", "imgs", "im", "rgb", "color", "colour", "colors", "colored", "gray", "grey", "view",
    "views", "frame", "frames", "picture", "pictures", "photo", "photos", "data", "cam", "camera", "cameras", "map",
    "maps", "png", "jpg", "pfm", "raw", "rect", "rectified", "ground", "input", "inputs", "stereo", "bit", "path",
    "paths", "file", "files", "filename",
}  # fmt: skip
_WORDS = re.compile(r"\d+bit|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_NUMBERED = re.compile(r"(im|img|image|colored|view|cam|camera)(\d{1,2})")
_NUMBER_PAIRS = (("0", "1"), ("00", "01"), ("2", "3"), ("02", "03"), ("2", "6"), ("1", "5"), ("1", "2"))
"""Left and right in KITTI, Middlebury and what cameras are called."""


@dataclass(frozen=True)
class Part:
    """What one file is."""

    role: Role
    key: str
    """What it shares with the files of the same pair."""
    split: str
    """train, val or test; empty if no folder says so."""
    preferred: bool = True
    """Whether it is taken where another file has the same role and key: KITTI's `disp_occ` before its `disp_noc`."""


def parts_of(paths: Sequence[PurePosixPath]) -> dict[PurePosixPath, Part]:
    """What the files are that are parts of pairs, by their paths relative to the set's folder.

    Raises:
        DatasetError: names of numbered views that can be understood in two ways.
    """
    read = {path: _words_of(path) for path in paths}
    numbers = _view_numbers(read)
    found = ((path, _part_of(path, words, numbers)) for path, words in read.items())
    return {path: part for path, part in found if part is not None}


def column_role(name: str) -> Role | None:
    """What a list's column of this name holds; None for anything else."""
    words = _split(name)
    view, kind = _view_of(words), _kind_of(words)
    if kind == "picture":
        return view if any(word in _VIEWS for word in words) else None
    return _role_of(kind, view)


def pair_keys(paths: Sequence[PurePosixPath]) -> list[str]:
    """What remains of the paths of left pictures without the words for views, splits and pictures, and without the
    folders that all of them are in."""
    keys = [PurePosixPath(_key([_rest(words) for words in _words_of(path)]) or path.stem) for path in paths]
    while (
        keys
        and len(keys[0].parts) > 1
        and all(len(k.parts) > 1 and k.parts[0] == keys[0].parts[0] for k in keys)
    ):
        keys = [PurePosixPath(*key.parts[1:]) for key in keys]
    return [key.as_posix() for key in keys]


_Words = tuple[str, ...]
_Numbers = Mapping[str, tuple[Literal["left", "right"], str]]


def _words_of(path: PurePosixPath) -> list[_Words]:
    """The words of each folder on the way, and of the file's name."""
    return [_split(part) for part in (*path.parts[:-1], path.stem)]


def _split(name: str) -> _Words:
    words = [word.lower() for word in _WORDS.findall(name)]
    split: list[str] = []
    for word in words:
        match = _ONE_WORD.fullmatch(word)
        split += [part for part in match.groups() if part] if match else [word]
    # A single l or r in the midst of a name is no view.
    return tuple(w.upper() if w in ("l", "r") and 0 < i < len(split) - 1 else w for i, w in enumerate(split))


def _view_numbers(read: Mapping[PurePosixPath, list[_Words]]) -> _Numbers:
    """Which view each numbered name is of, where files have such names and no words for views."""
    names: dict[str, set[str]] = {}
    for path, parts in read.items():
        if path.suffix.lower() not in PICTURES or any(word in _VIEWS for words in parts for word in words):
            continue
        for words in parts:
            if match := _NUMBERED.fullmatch("".join(words)):
                names.setdefault(match[1], set()).add(match[2])
    pairs = [
        (base, pair) for base, numbers in names.items() for pair in _NUMBER_PAIRS if numbers.issuperset(pair)
    ]
    if len(pairs) > 1:
        one, two = (f"{base}{left} and {base}{right}" for base, (left, right) in pairs[:2])
        raise DatasetError(f"the views could be {one} or {two}; a list names the files (list:FILE)")
    views: tuple[Literal["left", "right"], ...] = ("left", "right")
    return {
        f"{base}{number}": (view, number)
        for base, pair in pairs
        for view, number in zip(views, pair, strict=True)
    }


def _part_of(path: PurePosixPath, parts: list[_Words], numbers: _Numbers) -> Part | None:
    split, rest = "", []
    seen: list[str] = []
    numbered = None
    for level, words in enumerate(parts):
        is_file = level == len(parts) - 1
        if not is_file and len(words) == 1 and words[0] in _SPLITS and not split and not _masks(words, parts):
            split = _SPLITS[words[0]]
            continue
        if found := numbers.get("".join(words)):
            numbered = found[0]
            continue
        words, number = _without_number(words, numbers, is_file)
        numbered = number or numbered
        seen += words
        rest.append(_rest(words))
    kind = _kind_of(seen)
    if kind == "picture" and path.suffix.lower() in _NUMBERS_ONLY:
        kind = "disparity"
    spoken = next((_VIEWS[word] for word in seen if word in _VIEWS), None)
    view = spoken or numbered
    if kind is None or (kind == "picture" and (view is None or path.suffix.lower() not in PICTURES)):
        return None
    if kind == "disparity" and numbered == "right" and not spoken and (_OCCLUDED | _VISIBLE) & set(seen):
        return None  # KITTI's disp_occ_1 is the left view's, a frame later.
    role: Role | None = view if kind == "picture" else _role_of(kind, view or "left")
    if role is None:
        return None
    return Part(role, _key(rest), split, preferred=not (_VISIBLE & set(seen)))


def _masks(words: _Words, parts: list[_Words]) -> bool:
    """Whether a folder called valid holds masks: where no other folder says what its files are."""
    return words[0] == "valid" and not any(
        word in _VIEWS or word in _DISPARITY for each in parts for word in each
    )


def _without_number(
    words: _Words, numbers: _Numbers, is_file: bool
) -> tuple[_Words, Literal["left", "right"] | None]:
    """The words of a disparity's or a mask's name without the number of its view, as in disp0 and disp_occ_0."""
    if not (_DISPARITY | _VISIBLE) & set(words):
        return words, None
    digits = [word for word in words if word.isdigit()]
    if len(digits) != 1 or len(digits[0]) > 2:
        return words, None
    known: dict[str, Literal["left", "right"]] = {}
    if not is_file:  # In a file's name other numbers count the frames.
        known = {"0": "left", "1": "right"}
    known |= {number.lstrip("0") or "0": view for view, number in numbers.values()}
    view = known.get(digits[0].lstrip("0") or "0")
    return (words, None) if view is None else (tuple(word for word in words if word != digits[0]), view)


def _kind_of(words: Iterable[str]) -> str | None:
    """picture, disparity, occlusion, visible or valid; None for what is something else."""
    said = set(words)
    if said & _OTHER:
        return None
    if said & _DISPARITY:
        return "valid" if said & _VALID else "disparity"
    for kind, names in (
        ("visible", _VISIBLE),
        ("occlusion", _OCCLUDED),
        ("valid", _VALID),
        ("disparity", _TRUTH),
    ):
        if said & names:
            return kind
    return "picture"


def _view_of(words: Iterable[str]) -> Literal["left", "right"]:
    return "right" if any(_VIEWS.get(word) == "right" for word in words) else "left"


def _role_of(kind: str | None, view: str) -> Role | None:
    roles: dict[tuple[str | None, str], Role] = {
        ("disparity", "left"): "disparity",
        ("disparity", "right"): "disparity_right",
        ("occlusion", "left"): "occlusion",
        ("visible", "left"): "visible",
        ("valid", "left"): "valid",
    }
    return roles.get((kind, view))


_DROPPED = _VIEWS.keys() | _DISPARITY | _TRUTH | _OCCLUDED | _VISIBLE | _VALID | _SAY_NOTHING


def _rest(words: _Words) -> str:
    return "_".join(word for word in words if word not in _DROPPED and not word.endswith("bit"))


def _key(rest: Sequence[str]) -> str:
    return "/".join(part for part in rest if part)
