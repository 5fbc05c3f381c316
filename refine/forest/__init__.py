"""The random-forest confidence that the paper compares ConfNet with (its Fig. 7).

M. G. Park, K. J. Yoon, "Leveraging stereo matching with learning-based confidence measures", CVPR 2015: a forest on
features made by hand, here the twelve that need no cost volume (RDF_12).
"""

from refine.forest.features import FEATURES, confidence_features
from refine.forest.forest import Forest, ForestError, load_forest, save_forest

__all__ = ["FEATURES", "Forest", "ForestError", "confidence_features", "load_forest", "save_forest"]
