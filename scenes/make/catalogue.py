"""The made scenes by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from make.boxes import glossy, lights, water
from make.cabin import car_cabin
from make.candle import candle_flame
from make.cardioid import cardioid
from make.colonnade import colonnade
from make.corners import corner_room, glossy_room
from make.document import MadeScene
from make.door import door_slit
from make.egg import glass_egg
from make.fog import fog_sphere
from make.fractal import fractal_box
from make.glasses import cognac, three_glasses
from make.marble import marble
from make.museum import museum
from make.office import office
from make.plane import lit_plane
from make.prism import prism_and_screen
from make.room import skylight_room
from make.smoke import cornell_smoke

SCENES: dict[str, Callable[[], MadeScene]] = {
    "car_cabin": car_cabin,
    "candle_flame": candle_flame,
    "cardioid_100": partial(cardioid, 1.0),
    "cardioid_050": partial(cardioid, 0.5),
    "cardioid_010": partial(cardioid, 0.1),
    "cardioid_001": partial(cardioid, 0.01),
    "cognac": cognac,
    "colonnade": colonnade,
    "corner_room": corner_room,
    "cornell_fractal": fractal_box,
    "cornell_glossy": glossy,
    "cornell_lights": lights,
    "cornell_smoke": cornell_smoke,
    "cornell_water": water,
    "door_slit": door_slit,
    "fog_sphere": fog_sphere,
    "glass_egg": glass_egg,
    "glossy_room": glossy_room,
    "lit_plane": lit_plane,
    "marble": marble,
    "museum": museum,
    "office": office,
    "prism": prism_and_screen,
    "skylight_room": skylight_room,
    "three_glasses": three_glasses,
}
