"""One module a family; each defines `FAMILY` and is found by itself."""
