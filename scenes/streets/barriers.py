"""Walls, fences and railings close to the lane: at the kerb or along a narrow pavement, for a part of the street."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance import street_materials
from scenes.placement.assembly import Assembly
from scenes.random_draws import chance, choose, uniform
from scenes.shapes.street.boundaries import Fence
from scenes.streets.along_course import add_in_spans
from scenes.streets.config import DrivingConfig
from scenes.streets.frontage import Side
from scenes.streets.rig import Drive


@dataclass(frozen=True)
class Barrier:
    """A kind of barrier."""

    style: str
    """A style of `Fence`."""
    share: float
    """How many barriers are of this kind, relative to the others."""
    height_m: tuple[float, float]
    at_kerb: bool
    """Whether it stands at the kerb; else at the pavement's far edge."""


BARRIERS = (
    Barrier("wall", 0.4, (1.4, 3.6), False),
    Barrier("boards", 0.15, (1.7, 2.4), False),
    Barrier("railing", 0.2, (0.95, 1.2), True),
    Barrier("mesh", 0.1, (1.8, 2.8), False),
    Barrier("railing", 0.15, (1.4, 2.2), False),
)
"""Retaining walls and walls of works and gardens, hoardings, guard rails, wire mesh, tall railings."""


def add_barrier(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    side: Side,
    crossings: tuple[float, ...],
) -> None:
    """A barrier along some of the sides."""
    if not chance(rng, config.close_wall_share):
        return
    # Before shop windows and doors only a guard rail makes sense.
    kinds = [kind for kind in BARRIERS if kind.at_kerb or side.front_m - side.edge_m > 0.6]
    kind = choose(rng, kinds, [kind.share for kind in kinds])
    t = side.kerb_m + 0.45 if kind.at_kerb else side.edge_m - 0.06
    from_m = uniform(rng, drive.course.start_m, 8.0)
    to_m = from_m + uniform(rng, 25.0, 90.0)
    if kind.at_kerb:  # One has to get across.
        to_m = min([to_m, *(s - 4.0 for s in crossings if s > from_m)])
    if to_m - from_m < 8.0:
        return
    shape = replace(
        Fence.sample(rng, kind.style, drive.course),
        t_m=side.sign * t,
        height=uniform(rng, *kind.height_m),
        gates=kind.at_kerb,
    )
    material = scene.material(street_materials.fence(rng, kind.style, config.shares))
    end_m = min(to_m, drive.course.end_m)
    for number, (low, high) in enumerate(side.stretches(from_m, end_m)):
        add_in_spans(scene, f"barrier {side.name}{number}", shape, material, low, high)
