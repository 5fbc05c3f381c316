from .html import data_uri, render_page
from .pictures import (
    Picture,
    anaglyph,
    confidence_picture,
    disparity_picture,
    enlarged,
    error_picture,
    gradient_picture,
    index_picture,
    normals_picture,
    occlusion_picture,
    shrunk,
    side_by_side,
    stacked,
)
from .progress import JobProgress, duration

__all__ = [
    "JobProgress",
    "Picture",
    "anaglyph",
    "confidence_picture",
    "data_uri",
    "disparity_picture",
    "duration",
    "enlarged",
    "error_picture",
    "gradient_picture",
    "index_picture",
    "normals_picture",
    "occlusion_picture",
    "render_page",
    "shrunk",
    "side_by_side",
    "stacked",
]
