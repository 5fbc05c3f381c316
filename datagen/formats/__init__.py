"""Readers and writers of the files in a data set, one module for each format.

Arrays have row 0 at the top. A reader checks the header, and that the file has exactly the bytes that the header
promises, before it allocates anything. Whatever is wrong raises `datagen.errors.FormatError` with one sentence
that names the file; so does an array that the format cannot hold. A writer replaces its target in one step and
gives the same bytes for the same array.
"""

from datagen.formats.camera_data import read_camera_data, write_camera_data
from datagen.formats.cameras_json import cameras_record, read_cameras, write_cameras
from datagen.formats.depth_exr import read_depth, write_depth
from datagen.formats.flow import read_flow, write_flow
from datagen.formats.gradient_exr import read_gradient, write_gradient
from datagen.formats.normals_exr import read_normals, write_normals
from datagen.formats.occlusion import read_occlusion, write_occlusion
from datagen.formats.pfm import read_pfm, read_pfm_disparity, write_pfm
from datagen.formats.pgm import read_mask, write_mask
from datagen.formats.png import read_png, write_png

__all__ = [
    "cameras_record",
    "read_camera_data",
    "read_cameras",
    "read_depth",
    "read_flow",
    "read_gradient",
    "read_mask",
    "read_normals",
    "read_occlusion",
    "read_pfm",
    "read_pfm_disparity",
    "read_png",
    "write_camera_data",
    "write_cameras",
    "write_depth",
    "write_flow",
    "write_gradient",
    "write_mask",
    "write_normals",
    "write_occlusion",
    "write_pfm",
    "write_png",
]
