"""Moving and parked vehicles."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.appearance import street_materials, vehicle_materials
from scenes.appearance.materials import Shares
from scenes.placement.assembly import Assembly, ObjectGroup, anchored_object
from scenes.random_draws import chance, choose, uniform
from scenes.shapes.anchored import MetricShape
from scenes.shapes.street.cars import CarBody, CarDesign, CarGlass, CarLamps, CarTrim
from scenes.shapes.street.road import Course
from scenes.shapes.street.vans import CargoBox, VanBody, VanDesign, VanGlass, VanLamps, VanTrim
from scenes.shapes.street.vehicle_details import CarInterior, CarOccupant, NumberPlates, VanSign
from scenes.shapes.street.wheels import MIRROR_M, Wheel, WheelSet
from scenes.spec import SceneObject
from scenes.streets.config import DrivingConfig
from scenes.streets.frontage import Side
from scenes.streets.rig import Drive, Lane

PARKING_M = 2.35
"""Width of a parking lane."""
_KEY_M = 4.0
"""Key poses of a moving vehicle are at most this far apart."""
_TURN_KEY = 2.0
"""Key poses of a turning wheel are at most this far apart, radians."""
_FINE_M = 40.0
"""PartedShape vehicles farther along the street than this have coarser wheels."""
_CAR_KINDS = ("hatchback", "hatchback", "saloon", "estate", "suv", "suv")


@dataclass(frozen=True)
class Model:
    """A model of vehicle: its parts, with the materials that all its vehicles share, and its wheels."""

    length: float
    half_width: float
    """With the mirrors."""
    parts: tuple[tuple[str, MetricShape, int], ...]
    driver: tuple[tuple[str, MetricShape, int], ...]
    """Parts that only a vehicle that moves has."""
    painted: tuple[tuple[str, MetricShape], ...]
    """Parts that have each vehicle's own paint."""
    wheel: Wheel
    wheel_material: int
    wheels: tuple[tuple[float, float], ...]
    """x and y of each."""
    wheel_sets: tuple[WheelSet, WheelSet]
    """All wheels as one shape for a vehicle that stands: fine ones, and coarse ones for far away."""
    paint: Callable[[np.random.Generator], int]


@dataclass
class Fleet:
    """The models of vehicles in a scene; few, so that vehicles share their meshes."""

    cars: list[Model]
    large: list[Model]
    large_share: float

    def draw(self, rng: np.random.Generator) -> Model:
        """A random model; a large one in `large_share` of the draws."""
        return choose(rng, self.large if self.large and chance(rng, self.large_share) else self.cars)


def sample_fleet(
    rng: np.random.Generator, scene: Assembly, config: DrivingConfig, *, keep_left: bool, lit: bool
) -> Fleet:
    """Draw the models of vehicles of a scene; `lit` switches their lamps on."""
    shares = config.shares
    shared = {
        "dark glass": scene.material(vehicle_materials.dark_glass(rng)),
        "glass": scene.material(vehicle_materials.clear_glass(rng)),
        "seats": scene.material(vehicle_materials.upholstery(rng)),
        "plate": scene.material(vehicle_materials.number_plate(rng)),
        "trim": scene.material(street_materials.black_plastic()),
        "head": scene.material(street_materials.lamp((235, 240, 245), 5.0 if lit else 0.0)),
        "tail": scene.material(street_materials.lamp((170, 16, 18), 1.2 if lit else 0.0)),
    }
    paints = [scene.material(vehicle_materials.car_paint(rng, shares)) for _ in range(9)]
    cars = [_car_model(rng, scene, shares, shared, paints, keep_left) for _ in range(4)]
    kinds = choose(rng, [("van", "lorry"), ("van", "bus"), ("lorry", "bus"), ("van", "van")])
    large = [_van_model(rng, scene, shares, shared, paints, kind) for kind in kinds]
    return Fleet(cars, large, uniform(rng, *config.large_vehicle_share))


def _car_model(
    rng: np.random.Generator,
    scene: Assembly,
    shares: Shares,
    shared: dict[str, int],
    paints: list[int],
    keep_left: bool,
) -> Model:
    design = CarDesign.sample(rng, choose(rng, _CAR_KINDS))
    wheel = Wheel(design.wheel_radius, uniform(rng, 0.19, 0.23), 0.66)
    wheels = _wheel_places(design)
    clear = chance(rng, shares.transparent)
    parts: list[tuple[str, MetricShape, int]] = [
        ("glass", CarGlass(design), shared["glass" if clear else "dark glass"]),
        ("trim", CarTrim(design), shared["trim"]),
        (
            "plates",
            NumberPlates(design.length, design.clearance + 0.1, design.belt_height - 0.3),
            shared["plate"],
        ),
        ("head lamps", CarLamps(design, rear=False), shared["head"]),
        ("tail lamps", CarLamps(design, rear=True), shared["tail"]),
    ]
    driver: list[tuple[str, MetricShape, int]] = []
    if clear:
        # Traffic that keeps to the right is driven from the left.
        parts.append(("interior", CarInterior(design, not keep_left), shared["seats"]))
        body, head = (CarOccupant(design, not keep_left, head) for head in (False, True))
        driver.append(("driver", body, scene.material(street_materials.cloth(rng, shares))))
        driver.append(("driver's head", head, scene.material(street_materials.skin(rng))))
    return Model(
        length=design.length,
        half_width=design.width / 2 + MIRROR_M,
        parts=tuple(parts),
        driver=tuple(driver),
        painted=(("body", CarBody(design)),),
        wheel=wheel,
        wheel_material=scene.material(vehicle_materials.wheel(rng, wheel.radius, wheel.width)),
        wheels=wheels,
        wheel_sets=(WheelSet(wheel, wheels), WheelSet(replace(wheel, sides=12), wheels)),
        paint=lambda rng: choose(rng, paints),
    )


def _van_model(
    rng: np.random.Generator,
    scene: Assembly,
    shares: Shares,
    shared: dict[str, int],
    paints: list[int],
    kind: str,
) -> Model:
    design = VanDesign.sample(rng, kind)
    wheel = Wheel(design.wheel_radius, 0.23 if kind == "van" else 0.3, 0.66)
    wheels = _wheel_places(design)
    parts: list[tuple[str, MetricShape, int]] = [
        ("glass", VanGlass(design), shared["dark glass"]),
        ("trim", VanTrim(design), shared["trim"]),
        (
            "plates",
            NumberPlates(design.length, design.clearance + 0.08, design.clearance + 0.3),
            shared["plate"],
        ),
        ("head lamps", VanLamps(design, rear=False), shared["head"]),
        ("tail lamps", VanLamps(design, rear=True), shared["tail"]),
    ]
    lettering = vehicle_materials.lettering(rng, shares)
    if kind == "lorry":
        parts.append(("box", CargoBox(design), scene.material(lettering)))
    elif kind == "bus" or chance(rng, 0.6):
        parts.append(("sign", VanSign(design), scene.material(lettering)))
    return Model(
        length=design.length,
        half_width=design.width / 2 + MIRROR_M,
        parts=tuple(parts),
        driver=(),
        painted=(("body", VanBody(design)),),
        wheel=wheel,
        wheel_material=scene.material(vehicle_materials.wheel(rng, wheel.radius, wheel.width)),
        wheels=wheels,
        wheel_sets=(WheelSet(wheel, wheels), WheelSet(replace(wheel, sides=12), wheels)),
        paint=lambda rng: choose(rng, paints),
    )


def _wheel_places(design: CarDesign | VanDesign) -> tuple[tuple[float, float], ...]:
    return tuple((x, side * design.track) for x in design.axles for side in (1.0, -1.0))


def vehicle_of(name: str) -> str:
    """Name of the vehicle that a part belongs to: "parked L3" for the part "parked L3 head lamps"."""
    return " ".join(name.split()[:2])


def hull(thing: ObjectGroup) -> list[SceneObject]:
    """The large parts of a thing that is a vehicle; none of any other thing."""
    return [item for item in thing if item.name.endswith((" body", " box"))]


def _vehicle(
    rng: np.random.Generator,
    name: str,
    model: Model,
    course: Course,
    s_m: tuple[float, ...],
    t_m: float,
    turn_deg: float,
    times: tuple[float, ...],
) -> tuple[SceneObject, ...]:
    """A vehicle that stands at one place or passes through several at the given times.

    Its `name` is two words, with which its parts' names begin.
    """
    places = [course.place(s, t_m) for s in s_m]
    turns = [course.facing(s, turn_deg) for s in s_m]
    paint = model.paint(rng)
    parts = [*model.parts, *[(part, shape, paint) for part, shape in model.painted]]
    parts += model.driver if len(times) > 1 else ()
    objects = [
        anchored_object(f"{name} {part}", shape, material, places, turns, times)
        for part, shape, material in parts
    ]
    if len(times) == 1:
        wheels = model.wheel_sets[abs(s_m[0]) > _FINE_M]
        objects.append(anchored_object(f"{name} wheels", wheels, model.wheel_material, places, turns))
        return tuple(objects)
    forward = 1.0 if turn_deg == 0.0 else -1.0
    start = uniform(rng, 0.0, 2 * math.pi)
    for number, (x, y) in enumerate(model.wheels):
        rolled = _rolling(model.wheel.radius, s_m, times, forward, start)
        spots, attitudes = [], []
        for time, angle in zip(*rolled, strict=True):
            s = float(np.interp(time, times, s_m))
            facing = course.facing(s, turn_deg)
            foot = np.array(course.place(s, t_m))
            hub = foot + facing.apply((x, y, model.wheel.radius))
            spots.append((float(hub[0]), float(hub[1]), float(hub[2])))
            attitudes.append(facing * Rotation.from_euler("Y", angle))
        objects.append(
            anchored_object(
                f"{name} wheel {number}", model.wheel, model.wheel_material, spots, attitudes, rolled[0]
            )
        )
    return tuple(objects)


def _rolling(
    radius_m: float, s_m: tuple[float, ...], times: tuple[float, ...], forward: float, start: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Key times and angles of a wheel that rolls without slipping; the path's own keys are among them."""
    if len(times) == 1:
        return times, (start,)
    turn = abs(s_m[-1] - s_m[0]) / radius_m
    each = max(1, math.ceil(turn / (len(times) - 1) / _TURN_KEY))
    fine = np.linspace(times[0], times[-1], each * (len(times) - 1) + 1)
    angle = start + forward * (np.interp(fine, times, s_m) - s_m[0]) / radius_m
    return tuple(fine.tolist()), tuple(angle.tolist())


def add_moving(
    rng: np.random.Generator, scene: Assembly, config: DrivingConfig, drive: Drive, fleet: Fleet
) -> None:
    """Vehicles in all lanes; those of one lane have one speed, so that they keep their distances."""
    for number, lane in enumerate(drive.lanes):
        own = lane == drive.lane
        speed = (
            abs(drive.speed_m)
            if own
            else abs(drive.speed_m) * uniform(rng, 0.4, 1.5) + uniform(rng, 0.0, 0.2)
        )
        if not own and chance(rng, 0.15):
            speed = 0.0  # a queue
        _add_lane(rng, scene, drive, lane, fleet, speed, uniform(rng, *config.headway_m), f"car {number}")


def _add_lane(
    rng: np.random.Generator,
    scene: Assembly,
    drive: Drive,
    lane: Lane,
    fleet: Fleet,
    speed_m: float,
    headway_m: float,
    name: str,
) -> None:
    course = drive.course
    travel = speed_m * (drive.frames + 1) / 2
    low, high = course.start_m + 2.0, course.end_m - 2.0
    turn = 0.0 if lane.direction > 0 else 180.0
    s = low + uniform(rng, 0.0, headway_m)
    number = 0
    while True:
        model = fleet.draw(rng)
        middle = s + model.length / 2
        s += model.length + 2.0 + headway_m * uniform(rng, 0.3, 1.7)
        if middle + model.length / 2 + travel > high:
            return
        if middle - model.length / 2 - travel < low:
            continue
        if lane == drive.lane and -9.0 < middle - math.copysign(model.length / 2, middle) < 5.0:
            continue  # the rig's own place
        room = drive.lane_m / 2 - model.half_width - _swing_m(course, model, middle - travel, middle + travel)
        if room < 0.0:
            continue
        aside = uniform(rng, -1.0, 1.0) * min(room, 0.2)
        if speed_m == 0.0:
            path, times = (middle,), (0.0,)
        else:
            count = 2 + math.floor(2 * travel / _KEY_M)
            times = tuple(np.linspace(-1.0, float(drive.frames), count).tolist())
            path = tuple((middle + lane.direction * np.linspace(-travel, travel, count)).tolist())
        scene.add(*_vehicle(rng, f"{name}.{number}", model, course, path, lane.t_m + aside, turn, times))
        number += 1


def _swing_m(course: Course, model: Model, from_m: float, to_m: float) -> float:
    """How far the straight sides of a vehicle leave its lane where the lane bends."""
    s = np.arange(from_m - model.length / 2, to_m + model.length / 2 + 1.0, 1.0)
    curvature = np.abs(np.gradient(course.heading(s), s)).max()
    return float(curvature) * model.length**2 / 8


def add_parked(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    side: Side,
    fleet: Fleet,
    crossings: tuple[float, ...],
) -> None:
    """Vehicles along the kerb of a side with a parking lane."""
    if not side.parking:
        return
    taken = uniform(rng, *config.parked_share)
    with_traffic = (side.sign > 0) == drive.keep_left
    s, number = drive.course.start_m + 3.0, 0
    while True:
        model = fleet.draw(rng)
        middle = s + model.length / 2
        if 2 * model.half_width + 0.04 > PARKING_M:
            s += 0.1
            continue
        if middle + model.length / 2 > drive.course.end_m - 2.0:
            return
        s += model.length + uniform(rng, 0.7, 1.8)
        reach = 5.0 + model.length / 2
        blocked = side.is_open(middle, reach) or any(abs(middle - crossing) < reach for crossing in crossings)
        if blocked or not chance(rng, taken):
            continue
        room = PARKING_M / 2 - model.half_width - _swing_m(drive.course, model, middle, middle)
        if room < 0.0:
            continue
        t = side.sign * (side.kerb_m - PARKING_M / 2 + uniform(rng, -1.0, 1.0) * room)
        turn = 0.0 if with_traffic != chance(rng, 0.12) else 180.0
        name = f"parked {side.name}{number}"
        scene.add(*_vehicle(rng, name, model, drive.course, (middle,), t, turn, (0.0,)))
        number += 1


def add_waiting(
    rng: np.random.Generator,
    scene: Assembly,
    course: Course,
    fleet: Fleet,
    t_m: float,
    front_m: float,
    name: str,
) -> None:
    """A car that waits at the mouth of a side street, its front at s = `front_m`; `name` is two words."""
    model = choose(rng, fleet.cars)
    scene.add(*_vehicle(rng, name, model, course, (front_m + model.length / 2,), t_m, 180.0, (0.0,)))
