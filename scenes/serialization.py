"""Scenes and configs as plain data that JSON and YAML can hold, and back.

Shapes, textures and lights are written with their class name under "kind"; reading accepts only names that
are registered subclasses, so a scene file can build data but never run code.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from cattrs import Converter, transform_error
from cattrs.errors import ClassValidationError
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override
from cattrs.strategies import configure_tagged_union
from cattrs.v import format_exception

import scenes.motion.deformations
import scenes.shapes
import scenes.textures
from scenes.family import FamilyConfig
from scenes.registry import FAMILIES
from scenes.spec import NAME_ON_DISK, Deformation, Light, Scene, Shape, Texture
from scenes.user_assets.pool import USER_SHAPES, USER_TEXTURES
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import listed

T = TypeVar("T")


def _tagged(converter: Converter, base: Any, kinds: Mapping[str, type], tag: str = "kind") -> None:
    """Read and write any of `kinds` where the base class is asked for, its name under `tag`."""
    names = {kind: name for name, kind in kinds.items()}

    def structure(data: Any, _: Any) -> Any:
        kind = kinds.get(str(data.get(tag))) if isinstance(data, dict) else None
        if kind is None:
            raise InputError(
                f"a {base.__name__} needs {tag!r}, not {str(data)[:60]!r}; one of {listed([*kinds], most=6)}"
            )
        return converter.structure({key: value for key, value in data.items() if key != tag}, kind)

    converter.register_structure_hook_func(lambda cls: cls is base, structure)
    converter.register_unstructure_hook_func(
        lambda cls: cls is base,
        lambda item: {tag: names[type(item)], **converter.unstructure(item, type(item))},
    )


def _overrides(cls: Any) -> dict[str, Any]:
    """What a record's marked fields are called on disk, and which of them are left out at their default."""
    return {
        field.name: override(
            omit_if_default=field.metadata.get("omit_default"), rename=field.metadata.get(NAME_ON_DISK)
        )
        for field in fields(cls)
        if field.metadata
    }


def _make_converter() -> Converter:
    converter = Converter(forbid_extra_keys=True)
    converter.register_structure_hook_factory(
        is_dataclass,
        lambda cls: make_dict_structure_fn(cls, converter, _cattrs_forbid_extra_keys=True, **_overrides(cls)),
    )
    converter.register_unstructure_hook_factory(
        lambda cls: is_dataclass(cls) and any(field.metadata for field in fields(cls)),
        lambda cls: make_dict_unstructure_fn(cls, converter, **_overrides(cls)),
    )
    _tagged(converter, Shape, scenes.shapes.SHAPES | USER_SHAPES)
    _tagged(converter, Texture, scenes.textures.TEXTURES | USER_TEXTURES)
    _tagged(converter, Deformation, scenes.motion.deformations.DEFORMATIONS)
    _tagged(converter, FamilyConfig, {name: kind.config for name, kind in FAMILIES.items()}, tag="family")
    configure_tagged_union(Light, converter, tag_name="kind")
    return converter


_converter = _make_converter()


def to_plain(record: Any, kind: Any = None) -> Any:
    """A record as dicts, lists, strings and numbers, ready for JSON or YAML.

    Give the base class as `kind` where the reader will ask for it, so that the record's own class is written
    too.
    """
    return json.loads(json.dumps(_converter.unstructure(record, kind)))


def from_plain(data: Any, kind: type[T]) -> T:
    """The record of type `kind` that plain data describes.

    Raises ValueError, which says which field is wrong and why.
    """
    try:
        return _converter.structure(data, kind)
    except ClassValidationError as error:
        sentences = transform_error(error, path=kind.__name__, format_exception=_describe)
        raise InputError(listed(sentences, most=3, longest=200, separator="; ")) from error
    except (TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{kind.__name__}: {error}") from error


def _describe(error: BaseException, kind: type | None) -> str:
    """What is wrong with one field: our records' own words where they have some, else cattrs'."""
    own_words = type(error) is ValueError or type(error).__module__.split(".")[0] not in (
        "builtins",
        "cattrs",
    )
    return str(error) if own_words else format_exception(error, kind)


def scene_to_json(scene: Scene) -> str:
    """The scene as indented JSON text, which `scene_from_json` reads."""
    return json.dumps(_converter.unstructure(scene), indent=1)


def scene_from_json(text: str) -> Scene:
    """The scene that `scene_to_json` wrote. Raises ValueError with one sentence for any other text."""
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"not JSON: {error}") from error
    return from_plain(data, Scene)
