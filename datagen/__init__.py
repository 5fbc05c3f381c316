"""From scenes to data sets: pictures rendered in Blender, exact ground truth, and both on disk."""

from stereoforge_kit.siblings import check_siblings

check_siblings(__file__, "scenes")

from datagen.dataset.samples import StereoDataset, StereoSample
from datagen.errors import DatasetError, FormatError
from datagen.recipe.recipe import Recipe, read_recipe
from datagen.rendering.run import RenderSummary, render_dataset

__all__ = [
    "DatasetError",
    "FormatError",
    "Recipe",
    "RenderSummary",
    "StereoDataset",
    "StereoSample",
    "read_recipe",
    "render_dataset",
]
