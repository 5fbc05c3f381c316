"""Every file against its manifest, every disparity against its scene; and repair."""
