"""The command line, and the pipelines that join scenes, datagen, training and refine.

Examples:
    from stereoforge import StereoRefiner

    refiner = StereoRefiner()
    pair = refiner(left, right)  # (H, W, 3) uint8 each
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
