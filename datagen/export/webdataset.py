"""Shards for streaming (docs/conventions.md): tar files as webdataset reads them, with one sample for each frame.

The members of a sample have the same bytes as the data set's files, and the same frames give the same shards.
"""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace

from datagen.dataset.layout import EXTRA_TARGETS, KINDS, RENDER_PASSES, TARGETS, VIEWS, Layout
from datagen.dataset.manifest import FileEntry, file_entry, read_manifest, seal
from datagen.dataset.samples import StereoDataset, StereoSample
from datagen.errors import DatasetError
from datagen.formats import read_camera_data
from datagen.formats.cameras_json import rig_numbers
from datagen.recipe.recipe import read_recipe, write_recipe
from datagen.sources.webdataset import INDEX_NAME, META
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import Tree, temporary_folder


def export_webdataset(
    sets: Sequence[StereoDataset],
    out: Tree,
    frames_per_shard: int,
    progress: Callable[[int, int], None],
) -> None:
    """Write the frames of each split in order. Each shard is written whole or not at all.

    Args:
        sets: One data set for each split.
        out: The folder or URL to write to.
        frames_per_shard: Number of samples in one tar file.
        progress: Called with (frames done, frames in all).

    Raises:
        ValueError: For fewer than one frame in a shard.
        DatasetError: For damaged files, or a recipe that is not that of the scenes.
    """
    if frames_per_shard < 1:
        raise InputError(f"a shard holds at least one frame, got {frames_per_shard}")
    total, done = sum(map(len, sets)), 0
    index: dict[str, list[str]] = {}
    files: list[FileEntry] = []
    for frames in sets:
        for shard, first in enumerate(range(0, len(frames), frames_per_shard)):
            name = f"{frames.split}-{shard:06d}.tar"
            index[name] = []
            with out.writing(name) as path:
                with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as tar:
                    for sample in frames[first : first + frames_per_shard]:
                        index[name].append(_add(tar, sample))
                        done += 1
                        progress(done, total)
                files.append(replace(file_entry(path.parent, path), path=name))
    _write_recipe(out, sets[0][0])
    out.write(INDEX_NAME, seal({"shards": index, "files": [asdict(entry) for entry in files]}).encode())


def _write_recipe(out: Tree, sample: StereoSample) -> None:
    """Write the data set's recipe and the list of its user assets.

    Raises DatasetError if a sample's scene was rendered by another recipe.
    """
    layout = sample.layout
    recipe = read_recipe(layout.recipe)
    manifest = read_manifest(layout.local(layout.manifest(sample.split, sample.scene)))
    if recipe.settings_sha256() != manifest.recipe_sha256:
        raise DatasetError(f"{layout.recipe}: is not the recipe that the scenes were rendered by")
    with temporary_folder() as folder:
        staged = Layout(folder)
        write_recipe(staged.recipe, recipe)
        for path in (staged.asset_pool, staged.recipe):
            if path.exists():
                out.write(path.name, path.read_bytes())


def _add(tar: tarfile.TarFile, sample: StereoSample) -> str:
    """Add a sample's members to a shard; return the sample's key."""
    key = f"{sample.split}-{sample.scene:04d}-{sample.frame:04d}"
    members = dict(_members(sample))
    digests = {what: hashlib.sha256(data).hexdigest() for what, data in members.items()}
    members[META] = json.dumps(_meta(sample) | {"sha256": digests}, sort_keys=True).encode()
    for what, data in members.items():
        member = tarfile.TarInfo(f"{key}.{what}")  # Owner, rights and time are the same for all.
        member.size = len(data)
        tar.addfile(member, io.BytesIO(data))
    return key


def _members(sample: StereoSample) -> Iterator[tuple[str, bytes]]:
    for kind in (RENDER_PASSES[sample.render_pass], *TARGETS):
        for view in VIEWS if KINDS[kind].per_view else ():
            path = sample.layout.file(kind, sample.split, sample.scene, view, sample.frame)
            what = view if kind in RENDER_PASSES.values() else f"{kind}_{view}"
            yield f"{what}{path.suffix}", sample.intact(path).read_bytes()
    for kind in EXTRA_TARGETS:
        for direction in KINDS[kind].directions:
            for view in VIEWS:
                path = sample.layout.file(kind, sample.split, sample.scene, view, sample.frame, direction)
                if sample.has(path):
                    what = f"{kind}_{direction}_{view}" if direction else f"{kind}_{view}"
                    yield f"{what}{path.suffix}", sample.intact(path).read_bytes()


def _meta(sample: StereoSample) -> dict[str, object]:
    camera = sample.scene_record.camera
    path = sample.layout.file("camera_data", sample.split, sample.scene)
    poses = read_camera_data(sample.intact(path))[sample.frame]
    return {
        "split": sample.split,
        "scene": sample.scene,
        "frame": sample.frame,
        "render_pass": sample.render_pass,
        "family": sample.scene_record.family,
        **rig_numbers(camera),
        "cameras": {
            view: {name: matrix.tolist() for name, matrix in numbers.items()}
            for view, numbers in sample.cameras.items()
        },
        "poses": {view: pose.tolist() for view, pose in zip(VIEWS, poses, strict=True)},
    }
