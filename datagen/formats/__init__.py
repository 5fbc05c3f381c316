"""Readers and writers of the files in a data set, one module for each format.

Arrays have row 0 at the top. A reader checks the header, and that the file has exactly the bytes that the header
promises, before it allocates anything. Whatever is wrong raises `datagen.errors.FormatError` with one sentence
that names the file; so does an array that the format cannot hold. A writer replaces its target in one step and
gives the same bytes for the same array.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
