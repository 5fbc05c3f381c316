"""A data set as a page to look at, and two data sets side by side."""
