"""A replay as a recording for rerun's viewer: what the page shows, in three dimensions.

Lengths are metres, x east, y north, z up; nothing in it says where on Earth they are.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib.colors import to_rgba
from numpy.typing import NDArray

from wildlab.geometry.covariances import ellipse_axes
from wildlab.geometry.frames import ned_to_enu
from wildlab.replay.scene import MOST_NODES, Array, Estimates, Points, ReplayScene, heights, plain, relief
from wildlab.reporting.figures import BLUE, ORANGE, colour

#: Whose recordings and layouts belong together, and the time line.
APPLICATION, LINE = "wildlab replay", "time"
#: Corners of an ellipse, and the colour of truth.
CORNERS, TRUTH = 32, "#111111"


def save_recording(scene: ReplayScene, into: Path, shots: Mapping[int, bytes] | None = None) -> None:
    """Write a scene as ``.rrd``, with a layout that shows it; whole or not at all.

    Parameters
    ----------
    scene
        From `wildlab.replay.scene.scene_of`.
    into
        The file; what is there is replaced.
    shots
        JPEG by the row of the scene's views.
    """
    stream = rr.RecordingStream(APPLICATION, recording_id="replay", send_properties=False)
    stream.disable_timeline("log_time")
    stream.disable_timeline("log_tick")
    with tempfile.TemporaryDirectory(prefix=".", dir=into.parent) as work:
        part = Path(work) / into.name
        stream.save(part, default_blueprint=_layout(scene))
        _Writer(stream, scene.timed).all(scene, shots or {})
        stream.flush()
        stream.disconnect()
        part.replace(into)


def ellipse_rings(places: Array, covariance: Array) -> Array:
    """The 90 % ellipses about points on the ground.

    Parameters
    ----------
    places
        (N, 3) m in n.
    covariance
        (N, 2, 2) m^2, north before east.

    Returns
    -------
    (N, CORNERS + 1, 3) m in n, closed.
    """
    long_axis, short_axis, bearing = (one[:, None] for one in ellipse_axes(covariance))
    turn = np.linspace(0.0, 2 * np.pi, CORNERS + 1)
    along, across = long_axis * np.cos(turn), short_axis * np.sin(turn)
    rings = np.repeat(places[:, None, :], len(turn), axis=1)
    rings[..., 0] += along * np.cos(bearing) - across * np.sin(bearing)
    rings[..., 1] += along * np.sin(bearing) + across * np.cos(bearing)
    return rings


def _decoded(jpeg: bytes) -> NDArray[Any]:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE))


def _look(color: str, points: float) -> dict[str, Any]:
    """Colour, and size on the screen."""
    rgba = [round(255 * share) for share in to_rgba(color)]
    return {"colors": [rgba], "radii": rr.Radius.ui_points(points)}


def _part(name: str) -> str:
    """A name as one part of an entity's path."""
    return rr.escape_entity_path_part(plain(name)) or "no name"


def _layout(scene: ReplayScene) -> Any:
    """The map, the image beside it and plots below; rerun's own panels are folded but for the time line."""
    views: list[Any] = [rrb.Spatial3DView(origin="/world", name="Map")]
    if scene.views is not None:
        views.append(rrb.Spatial2DView(origin="/image", name="Image"))
    names = {"error": "Error (m)", "nees": "NEES", "height": "Height above ground (m)"}
    plots = [rrb.TimeSeriesView(origin=f"/plots/{part}", name=name) for part, name in names.items()]
    return rrb.Blueprint(
        rrb.Vertical(rrb.Horizontal(*views), rrb.Horizontal(*plots), row_shares=[3, 1]), collapse_panels=True
    )


class _Writer:
    """Logs the parts of a scene; entities are named by what they are, and by the scene's own names."""

    def __init__(self, stream: Any, timed: bool) -> None:
        self.stream, self.timed = stream, timed

    def all(self, scene: ReplayScene, shots: Mapping[int, bytes]) -> None:
        self.fixed("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        if scene.terrain is not None:
            self.ground(scene)
        if scene.path is not None:
            self.way("world/aircraft", scene.path.times, scene.path.places, BLUE)
            self.plot("plots/height/aircraft", scene.path.times, heights(scene), BLUE)
        if scene.views is not None:
            self.views(scene, shots)
        if scene.points is not None:
            self.judged("points", scene.points, ORANGE)
        for one in scene.tracks:
            self.judged(f"tracks/{_part(one.filter)}/{_part(one.target)}/{_part(one.sensor)}", one,
                        colour(one.filter))  # fmt: skip
        for target in scene.truth:
            self.way(f"world/truth/{_part(target.name)}", target.times, target.places, TRUTH)

    def fixed(self, entity: str, *what: Any) -> None:
        self.stream.log(entity, *what, static=True, strict=True)

    def columns(self, entity: str, times: Array, columns: Any, counts: Any = None) -> None:
        """What an entity has at each time: one row, or as many as ``counts`` says."""
        at = (
            rr.TimeColumn(LINE, duration=np.asarray(times, float))
            if self.timed
            else rr.TimeColumn(LINE, sequence=np.asarray(times).round().astype(np.int64))
        )
        parted = columns if counts is None else [column.partition(counts) for column in columns]
        if len(times):
            self.stream.send_columns(entity, [at], list(parted), strict=True)

    def way(self, entity: str, times: Array, places: Array, color: str) -> None:
        """A line, and the dot that moves along it; what never moves is a dot."""
        known = np.isfinite(times)
        if not known.any():
            self.fixed(entity, rr.Points3D(ned_to_enu(places), **_look(color, 4)))
            return
        self.fixed(f"{entity}/path", rr.LineStrips3D([ned_to_enu(places)], **_look(color, 1)))
        self.fixed(f"{entity}/now", rr.Points3D.from_fields(**_look(color, 5)))
        dots = rr.Points3D.columns(positions=ned_to_enu(places[known]))
        self.columns(f"{entity}/now", times[known], dots)

    def plot(self, entity: str, times: Array, values: Array, color: str) -> None:
        known = np.isfinite(values) & np.isfinite(times)
        if known.any():
            self.fixed(entity, rr.SeriesLines(colors=_look(color, 1)["colors"]))
            self.columns(entity, times[known], rr.Scalars.columns(scalars=values[known]))

    def judged(self, entity: str, of: Points | Estimates, color: str) -> None:
        """Places with their ellipses, where these are known, errors and NEES."""
        times, counts = np.unique(of.times, return_counts=True)
        look = rr.Points3D.from_fields(**_look(color, 3))
        self.fixed(f"world/{entity}/places", look)
        positions = rr.Points3D.columns(positions=ned_to_enu(of.places))
        self.columns(f"world/{entity}/places", times, positions, counts)
        known = np.isfinite(of.covariance).all(axis=(1, 2)) & np.isfinite(of.places).all(axis=1)
        if known.any():
            rings = ned_to_enu(ellipse_rings(of.places[known], of.covariance[known]))
            times, counts = np.unique(of.times[known], return_counts=True)
            self.fixed(f"world/{entity}/ellipses", rr.LineStrips3D.from_fields(**_look(color, 1)))
            strips = rr.LineStrips3D.columns(strips=list(rings))
            self.columns(f"world/{entity}/ellipses", times, strips, counts)
        self.plot(f"plots/error/{entity}", of.times, of.error, color)
        self.plot(f"plots/nees/{entity}", of.times, of.nees, color)

    def views(self, scene: ReplayScene, shots: Mapping[int, bytes]) -> None:
        """Borders of images on the ground, the pictures that there are, and what was seen in them."""
        views, rows = scene.views, sorted(shots)
        assert views is not None  # noqa: S101 - for the type checker
        placed = np.isfinite(views.outlines).all(axis=(1, 2))
        if placed.any():
            down = scene.ground if np.isfinite(scene.ground) else 0.0
            flat = np.concatenate([views.outlines, views.outlines[:, :1]], axis=1)[placed]
            rings = ned_to_enu(np.concatenate([flat, np.full((*flat.shape[:2], 1), down)], axis=2))
            strips = rr.LineStrips3D.columns(strips=list(rings))
            self.columns("world/footprint", views.times, strips, placed.astype(int))
        if rows:
            self.fixed("image", rr.EncodedImage.from_fields(media_type="image/jpeg"))
            blobs = rr.EncodedImage.columns(blob=[shots[row] for row in rows])
            self.columns("image", views.times[rows], blobs)
        elif scene.camera is not None:
            size = [scene.camera.width, scene.camera.height]
            self.fixed("image/border", rr.Boxes2D(mins=[[0, 0]], sizes=[size]))
        if scene.sightings is not None:
            seen, scale = scene.sightings, np.ones((len(views.times), 1))
            if scene.camera is not None:
                widths = [_decoded(shots[row]).shape[1] for row in rows]
                scale[rows, 0] = np.array(widths) / scene.camera.width
            order = np.argsort(seen.frame, kind="stable")
            self.fixed("image/seen", rr.Points2D.from_fields(**_look(ORANGE, 6)))
            dots = rr.Points2D.columns(
                positions=(seen.uv[order] + 0.5) * scale[seen.frame[order]],
                labels=[plain(one) for one in seen.names[order]],
            )
            counts = np.bincount(seen.frame, minlength=len(views.times))
            self.columns("image/seen", views.times, dots, counts)

    def ground(self, scene: ReplayScene) -> None:
        """Terrain as triangles; those with an unknown corner are left out."""
        assert scene.terrain is not None  # noqa: S101 - for the type checker
        height, colours = relief(scene.terrain.height, scene.terrain.step)
        rows, columns = height.shape
        step = scene.terrain.step * max(1, -(-max(scene.terrain.height.shape) // MOST_NODES))
        east, north = (
            scene.terrain.east + step * np.arange(columns),
            scene.terrain.north + step * np.arange(rows),
        )
        x, y = np.meshgrid(east, north)
        at = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = (one.ravel() for one in (at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]))
        triangles = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
        surface = rr.Mesh3D(
            vertex_positions=np.stack([x, y, np.nan_to_num(height)], axis=-1).reshape(-1, 3),
            triangle_indices=triangles[np.isfinite(height.ravel())[triangles].all(axis=1)],
            vertex_colors=colours.reshape(-1, 3),
        )
        self.fixed("world/terrain", surface)
