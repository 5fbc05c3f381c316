"""Cars, vans, lorries and buses, part by part: body, glass, trim, lamps, wheels.

A vehicle's parts share one design and one origin: the ground below its middle; x is forward, y to the left,
z up, metres.
"""

from __future__ import annotations

from scenes.shapes.street.cars import CarBody, CarGlass, CarLamps, CarTrim
from scenes.shapes.street.vans import CargoBox, VanBody, VanGlass, VanLamps, VanTrim
from scenes.shapes.street.wheels import Wheel, WheelSet

VEHICLE_PARTS = (
    *(CarBody, CarGlass, CarTrim, CarLamps),
    *(VanBody, CargoBox, VanGlass, VanTrim, VanLamps),
    *(Wheel, WheelSet),
)
"""Kinds of shapes that are parts of vehicles."""
