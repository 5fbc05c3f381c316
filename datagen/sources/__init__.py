"""Readers of data sets, one module a kind, found by themselves: a module has a tuple `FORMATS` of `SourceFormat`.

What their encodings share in memory: disparity positive for both views, in pixels of the image, NaN where there is
none. Each module says what its files mean and what is derived.
"""
