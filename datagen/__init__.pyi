from .dataset.samples import StereoDataset, StereoSample
from .errors import DatasetError, FormatError
from .recipe.recipe import Recipe, read_recipe
from .rendering.run import RenderSummary, render_dataset

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
