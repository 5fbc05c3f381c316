"""Shapes without a size or a place of their own: solids, sheets, wires."""
