"""Scenes: what a thermal camera would see of a sea and of what floats on it, with exact labels.

A scene is rendered from a pose, with the projection of `wildlab.geometry`; what is found in it is then judged
against labels that are known and not marked by anybody. `bodies` has vessels, people, buoys and animals,
`sea` the water, `render` makes kelvin and labels, `response` the image of a camera with its faults; and
`coloured` the ground and a tarpaulin as a colour camera sees them. All of it is chosen; nothing in it knows
of a detector.

A body's temperatures are even parts, textures and hot places; there is no heat flow, no spray, no reflection
of the body in the water, and no weather between.
"""

from wildlab.simulation.scene.bodies import (
    KINDS,
    Body,
    Hot,
    Layer,
    Wake,
    boat,
    buoy,
    mammal,
    person,
    rectangle,
    vessel,
)
from wildlab.simulation.scene.coloured import ColourView, Ground, Tarpaulin, render_colour
from wildlab.simulation.scene.render import Scene, Seen, View, outline_of, render
from wildlab.simulation.scene.response import (
    IDEAL,
    CameraResponse,
    Sensor,
    expose,
    gain_control,
    in_shutter,
    sensor_of,
    shutter_image,
    to_kelvin,
)
from wildlab.simulation.scene.sea import EVEN, Sea

__all__ = [
    "EVEN",
    "IDEAL",
    "KINDS",
    "Body",
    "CameraResponse",
    "ColourView",
    "Ground",
    "Hot",
    "Layer",
    "Scene",
    "Sea",
    "Seen",
    "Sensor",
    "Tarpaulin",
    "View",
    "Wake",
    "boat",
    "buoy",
    "expose",
    "gain_control",
    "in_shutter",
    "mammal",
    "outline_of",
    "person",
    "rectangle",
    "render",
    "render_colour",
    "sensor_of",
    "shutter_image",
    "to_kelvin",
    "vessel",
]
