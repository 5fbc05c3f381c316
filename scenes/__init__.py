"""Scenes as plain records, and the families that sample them. Needs neither Blender nor torch."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
