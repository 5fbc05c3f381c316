"""One module for each format of disparity files, with a `FORMAT`."""
