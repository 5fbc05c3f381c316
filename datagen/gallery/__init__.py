"""HTML pages that show a data set, or compare two."""
