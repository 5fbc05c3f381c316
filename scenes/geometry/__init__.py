"""Triangle meshes and how they are built: solids, implicit surfaces, stems and leaves."""
