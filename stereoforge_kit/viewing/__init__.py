"""Pictures of stereo data and self-contained HTML pages to put them in.

Used by the gallery of `datagen`, the image panels of `training` and the report of `refine`; imports none of
them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
