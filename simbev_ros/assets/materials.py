"""Surface materials of triangles, and their properties for shaders and lidar, which materials.yaml lists."""

from dataclasses import dataclass, fields
from enum import IntEnum
from functools import lru_cache

import numpy as np

from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float32Array


class Material(IntEnum):
    """Material of a triangle. ``uv`` is in meters along the surface unless stated otherwise."""

    PLAIN = 0
    ASPHALT = 1
    MARKING = 2
    PAVING = 3  # sidewalk slabs; uv = map x, y
    CONCRETE = 4  # curbs, pole bases, parapets
    GRASS = 5
    SOIL = 6
    BRICK = 7
    PLASTER = 8
    FACADE = 9  # plastered wall with windows: u along the wall, v above the ground; no windows where v is below 0
    OFFICE_GLASS = 10  # curtain wall: u along the wall, v above the ground
    SHOPFRONT = 11  # ground floor with doors and display windows: u along the wall, v above the ground
    ROOF = 12
    WOOD = 13
    METAL = 14
    GLASS = 15
    CAR_PAINT = 16  # its albedo is the actor's color
    RUBBER = 17
    CHROME = 18
    PLASTIC = 19
    FOLIAGE = 20
    BARK = 21
    CLOTH = 22
    CLOTH_TINTED = 23  # its albedo is the actor's color
    SKIN = 24  # its albedo depends on the actor's tone of skin
    HAIR = 25  # its albedo is the actor's color of hair
    WATER = 26
    PLATE = 27
    LAMP_LOW_BEAM = 28
    LAMP_TAIL = 29  # lit weakly with the low beam, strongly when braking
    LAMP_TURN_LEFT = 30
    LAMP_TURN_RIGHT = 31
    LAMP_REVERSE = 32
    LAMP_EMERGENCY = 33
    SIGNAL_RED = 34  # uv[0] = row of the signal in the signals table, for the three signal lamps
    SIGNAL_YELLOW = 35
    SIGNAL_GREEN = 36
    STREET_LAMP = 37  # uv[0] = index of the street light
    BRICK_FACADE = 38  # this and the next three: windows as in FACADE
    TIMBER_FACADE = 39
    CONCRETE_FACADE = 40
    METAL_FACADE = 41
    CROP = 42  # a field: rows run along u
    TUNNEL_LAMP = 43  # always lit
    CLOTH_SECOND = 44  # its albedo is the actor's second color
    LEATHER = 45  # its albedo is the actor's color of leather
    TWIG = 46


@dataclass(frozen=True, slots=True)
class MaterialTable:
    """Properties of all materials: (len(Material),) float32 arrays indexed by ``Material``; see materials.yaml."""

    roughness: Float32Array
    metallic: Float32Array
    specular: Float32Array
    lidar_reflectance: Float32Array
    lidar_retroreflection: Float32Array
    lidar_retroreflection_fall: Float32Array
    lidar_transmission: Float32Array
    lidar_mirror: Float32Array
    lidar_wet: Float32Array
    lidar_texture_db: Float32Array


_WITHOUT = {
    "lidar_retroreflection": 0.0,
    "lidar_retroreflection_fall": 0.0,
    "lidar_transmission": 0.0,
    "lidar_mirror": 0.0,
    "lidar_wet": 1.0,
    "lidar_texture_db": 0.0,
}


@lru_cache(maxsize=1)
def load_materials() -> MaterialTable:
    """Load materials.yaml."""
    entries = load_table("simbev_ros.assets", "materials.yaml")

    def column(name: str) -> Float32Array:
        rows = (_WITHOUT | entries[material.name] for material in Material)
        return np.array([row[name] for row in rows], np.float32)

    return MaterialTable(*(column(field.name) for field in fields(MaterialTable)))
