"""From scenes to data sets: pictures rendered in Blender, exact ground truth, and both on disk."""

import lazy_loader

from stereoforge_kit.siblings import check_siblings

check_siblings(__file__, "scenes")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
