"""Stereo matching without learning: semi-global block matching, left-right consistency, filling of holes.

Numpy arrays in and out; knows nothing of data sets, networks or the refinement, which all use it.
"""

from stereoforge_kit.matching.consistency import INCONSISTENT, left_right_consistency
from stereoforge_kit.matching.holes import fill_background, fill_nearest
from stereoforge_kit.matching.sgbm import SGBMParameters, match_both, match_sgbm
from stereoforge_kit.matching.swapped_views import seem_swapped

__all__ = [
    "INCONSISTENT",
    "SGBMParameters",
    "fill_background",
    "fill_nearest",
    "left_right_consistency",
    "match_both",
    "match_sgbm",
    "seem_swapped",
]
