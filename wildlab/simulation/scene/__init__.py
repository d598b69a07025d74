"""Scenes: what a thermal camera would see of sea and land and of what is on them, with exact labels.

A scene is rendered from a pose, with the projection of `wildlab.geometry`; what is found in it is then judged
against labels that are known and not marked by anybody. `bodies` has vessels and what stands
on land; `sea` the water, `render` makes kelvin and labels, `response` the image of a camera with
its faults. `ground` has covers under the sun of a day, and `land` renders them.
`coloured` is even ground and a tarpaulin as a colour camera sees them. All of it is chosen; nothing in it
knows of a detector.

A body's temperatures are even parts, textures and hot places; there is no heat flow, no spray, no reflection
of the body in the water, and no weather between.
"""

from wildlab.simulation.scene.bodies import (
    ANIMALS,
    Body,
    Hot,
    Kind,
    Layer,
    Wake,
    animal,
    rectangle,
    scatter,
    slab,
    stone,
    tree,
    vessel,
)
from wildlab.simulation.scene.coloured import ColourView, Ground, Tarpaulin, render_colour
from wildlab.simulation.scene.ground import (
    EVEN_LAND,
    GRASS,
    ROCK,
    SAND,
    Cover,
    Land,
    Weather,
    rolling_land,
)
from wildlab.simulation.scene.land import LandScene, LandView, ground_points, height_at, render_land
from wildlab.simulation.scene.render import RenderedView, Scene, SeenBody, outline_of, render
from wildlab.simulation.scene.response import (
    IDEAL,
    CameraResponse,
    Sensor,
    expose,
    sensor_of,
)
from wildlab.simulation.scene.sea import EVEN, Sea

__all__ = [
    "ANIMALS",
    "EVEN",
    "EVEN_LAND",
    "GRASS",
    "IDEAL",
    "ROCK",
    "SAND",
    "Body",
    "CameraResponse",
    "ColourView",
    "Cover",
    "Ground",
    "Hot",
    "Kind",
    "Land",
    "LandScene",
    "LandView",
    "Layer",
    "RenderedView",
    "Scene",
    "Sea",
    "SeenBody",
    "Sensor",
    "Tarpaulin",
    "Wake",
    "Weather",
    "animal",
    "expose",
    "ground_points",
    "height_at",
    "outline_of",
    "rectangle",
    "render",
    "render_colour",
    "render_land",
    "rolling_land",
    "scatter",
    "sensor_of",
    "slab",
    "stone",
    "tree",
    "vessel",
]
