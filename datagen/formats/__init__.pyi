from .camera_data import read_camera_data, write_camera_data
from .cameras_json import cameras_record, read_cameras, write_cameras
from .depth_exr import read_depth, write_depth
from .flow import read_flow, write_flow
from .gradient_exr import read_gradient, write_gradient
from .normals_exr import read_normals, write_normals
from .occlusion import read_occlusion, write_occlusion
from .pfm import read_pfm, read_pfm_disparity, write_pfm
from .pgm import read_mask, write_mask
from .png import read_png, write_png

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
