"""Pictures of stereo data and self-contained HTML pages to put them in.

Used by the gallery of `datagen`, the image panels of `training` and the report of `refine`; imports none of
them.
"""

from stereoforge_kit.viewing.html import data_uri, render_page
from stereoforge_kit.viewing.pictures import (
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
from stereoforge_kit.viewing.progress import JobProgress, duration

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
