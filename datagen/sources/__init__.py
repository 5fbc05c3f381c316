"""Readers of data sets, one module for each kind.

A module with a tuple `FORMATS` of `SourceFormat` is found without being registered. In memory all sets look alike: the
disparity is positive for both views, in pixels of the image, and NaN where there is none. Each module says what its
files mean and what is derived from them.
"""
