"""A scene as a recording for rerun's viewer: an ``.rrd`` file.

In it x is east, y north and z up, metres, as rerun's views want it. The one time line counts seconds from the
first pose (or images, where the flight knows no time); rerun's own ones, which say when the file was made,
are left out, and so are its properties (when it was begun, what it was called).
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from wildlab.geometry.frames import ned_to_enu
from wildlab.replay.colours import FLOWN, GROUND, SIGHTING, TRUTH, VIEW, of_filter, rgba
from wildlab.replay.scene import Array, Estimates, Points, ReplayScene, heights
from wildlab.replay.shapes import ellipse_rings, mesh
from wildlab.replay.shots import Shot
from wildlab.replay.words import about, path_part, plain

#: Whose layouts and recordings belong together.
APPLICATION = "wildlab replay"
#: Time lines.
SECONDS, IMAGES = "flight_time", "image"
#: The 95 % band of a NEES with two degrees of freedom is drawn in the plot.
NEES_BAND = (0.05063561596857975, 7.377758908227871)


def save_recording(
    scene: ReplayScene,
    into: FilePath,
    shots: Mapping[int, Shot] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Write a scene as ``.rrd``, with a layout that shows it; whole or not at all.

    Parameters
    ----------
    scene
        From `wildlab.replay.gather.scene_of`.
    into
        The file; what is there is replaced.
    shots
        Pictures by the row of the scene's views.
    tell
        Is told what is being written.
    """
    # Before rerun is imported: nothing of this is counted by anybody.
    import rerun as rr

    from wildlab.replay.blueprint import blueprint_of

    handle, name = tempfile.mkstemp(prefix=f".{into.name}.", dir=into.parent)
    os.close(handle)
    part = FilePath(name)
    try:
        stream = _stream(rr)
        stream.save(part, default_blueprint=blueprint_of(scene))
        _Writer(rr, stream, scene).all(shots or {}, tell)
        stream.flush()
        stream.disconnect()
        part.chmod(0o644)
        part.replace(into)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def narrow_layout(scene: ReplayScene) -> bytes:
    """The layout for a narrow screen, which a viewer may be given after the recording."""
    from wildlab.replay.blueprint import blueprint_of

    with tempfile.TemporaryDirectory(prefix="wildlab-layout.") as folder:
        file = FilePath(folder) / "narrow.rbl"
        blueprint_of(scene, narrow=True).save(APPLICATION, file)
        return file.read_bytes()


def log_scene(scene: ReplayScene) -> Any:
    """A scene as a stream of rerun that a widget shows; nothing is written.

    Parameters
    ----------
    scene
        From `wildlab.replay.gather.scene_of`.

    Returns
    -------
    rerun.RecordingStream
    """
    import rerun as rr

    stream = _stream(rr)
    _Writer(rr, stream, scene).all({}, lambda _: None)
    return stream


def _stream(rr: Any) -> Any:
    stream = rr.RecordingStream(APPLICATION, recording_id="replay", send_properties=False)
    stream.disable_timeline("log_time")
    stream.disable_timeline("log_tick")
    return stream


class _Writer:
    """Logs the parts of a scene, each once."""

    def __init__(self, rr: Any, stream: Any, scene: ReplayScene) -> None:
        self.rr, self.stream, self.scene = rr, stream, scene
        low, high = scene.extent
        #: Sizes on the ground that can be seen: a share of what is shown.
        self.size = max(float(np.linalg.norm((high - low)[:2])), 1.0)

    def all(self, shots: Mapping[int, Shot], tell: Callable[[str], None]) -> None:
        self.static("about", self.rr.TextDocument(about(self.scene, len(shots)), media_type="text/markdown"))
        self.static("world", self.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        tell("the ground")
        self.ground()
        tell("the aircraft")
        self.path()
        tell("what the camera saw")
        self.views(shots)
        self.sightings(shots)
        tell("points and tracks")
        self.points()
        for one in self.scene.tracks:
            self.track(one)
        self.truth()

    def static(self, entity: str, *what: Any) -> None:
        self.stream.log(entity, *what, static=True, strict=True)

    def at(self, times: Array) -> list[Any]:
        if self.scene.timed:
            return [self.rr.TimeColumn(SECONDS, duration=np.asarray(times, float))]
        return [self.rr.TimeColumn(IMAGES, sequence=np.asarray(times).round().astype(np.int64))]

    def columns(self, entity: str, times: Array, *columns: Any) -> None:
        if len(times):
            self.stream.send_columns(entity, self.at(times), columns, strict=True)

    def ground(self) -> None:
        rr, scene = self.rr, self.scene
        if scene.terrain is not None:
            vertices, triangles, colours, normals = mesh(
                scene.terrain.height, *_corner(scene), scene.terrain.step
            )
            self.static(
                "world/terrain",
                rr.Mesh3D(
                    vertex_positions=vertices,
                    triangle_indices=triangles,
                    vertex_colors=colours,
                    vertex_normals=normals,
                ),
            )
        elif np.isfinite(scene.ground):
            low, high = scene.extent
            margin = 0.1 * self.size
            n, e = (low[0] - margin, high[0] + margin), (low[1] - margin, high[1] + margin)
            corners = np.array([[n[i], e[j], scene.ground] for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))])
            # A little below what lies on it, which would flicker in it.
            corners = ned_to_enu(corners) - np.array([0.0, 0.0, 0.003 * self.size])
            self.static(
                "world/ground",
                rr.Mesh3D(
                    vertex_positions=corners,
                    triangle_indices=[[0, 1, 2], [0, 2, 3]],
                    vertex_colors=[rgba(GROUND)] * 4,
                ),
            )

    def path(self) -> None:
        rr, path = self.rr, self.scene.path
        if path is None:
            return
        enu = ned_to_enu(path.places)
        self.static(
            "world/flown/path",
            rr.LineStrips3D([enu], colors=[rgba(FLOWN, 0.45)], radii=rr.Radius.ui_points(1.0)),
        )
        self.static(
            "world/flown/aircraft",
            rr.Points3D.from_fields(
                colors=[rgba(FLOWN)], radii=rr.Radius.ui_points(6.0), labels=["aircraft"], show_labels=False
            ),
        )
        self.columns("world/flown/aircraft", path.times, *rr.Points3D.columns(positions=enu))
        height = heights(self.scene)
        self.static(
            "plots/height/aircraft", rr.SeriesLines(colors=[rgba(FLOWN)], names=["height (m)"], widths=[1.5])
        )
        self._scalars("plots/height/aircraft", path.times, height)

    def _scalars(self, entity: str, times: Array, values: Array) -> None:
        known = np.isfinite(values) & np.isfinite(times)
        self.columns(entity, times[known], *self.rr.Scalars.columns(scalars=values[known]))

    def views(self, shots: Mapping[int, Shot]) -> None:
        rr, views, camera = self.rr, self.scene.views, self.scene.camera
        if views is None:
            return
        if camera is not None:
            s = next(iter(shots.values())).scale if shots else 1.0
            self.static(
                "world/camera/image",
                rr.Pinhole(
                    focal_length=(camera.fx * s, camera.fy * s),
                    principal_point=((camera.cx + 0.5) * s, (camera.cy + 0.5) * s),
                    resolution=(camera.width * s, camera.height * s),
                    camera_xyz=rr.ViewCoordinates.RDF,
                    image_plane_distance=0.06 * self.size,
                    color=rgba(VIEW),
                    line_width=rr.Radius.ui_points(1.5),
                ),
            )
            w, h = camera.width * s, camera.height * s
            frame = rr.Boxes2D(
                mins=[[0, 0]], sizes=[[w, h]], colors=[rgba(VIEW, 0.6)], radii=rr.Radius.ui_points(1.0)
            )
            self.static("world/camera/image/border", frame)
            posed = np.isfinite(views.p_nc).all(axis=1) & np.isfinite(views.R_nc).all(axis=(1, 2))
            self.columns(
                "world/camera",
                views.times[posed],
                *rr.Transform3D.columns(
                    translation=ned_to_enu(views.p_nc[posed]),
                    mat3x3=_turned(views.R_nc[posed]),
                ),
            )
            placed = np.atleast_1d(np.isfinite(views.outlines).all(axis=(1, 2)))
            strips = [
                ned_to_enu(np.vstack([one, one[:1]])) if ok else np.empty((0, 3))
                for one, ok in zip(views.outlines, placed, strict=True)
            ]
            self.static(
                "world/footprint",
                rr.LineStrips3D.from_fields(colors=[rgba(VIEW)], radii=rr.Radius.ui_points(2.0)),
            )
            self._strips("world/footprint", views.times, strips)
        if shots:
            rows = np.array(sorted(shots))
            self.static("world/camera/image", rr.EncodedImage.from_fields(media_type="image/jpeg"))
            self.columns(
                "world/camera/image",
                views.times[rows],
                *rr.EncodedImage.columns(blob=[shots[int(row)].jpeg for row in rows]),
            )

    def _strips(self, entity: str, times: Array, strips: list[Array]) -> None:
        """One closed line, or none, at each time."""
        rr = self.rr
        there = [one for one in strips if len(one)]
        if not there:
            return
        columns = rr.LineStrips3D.columns(strips=there)
        parted = [column.partition([int(len(one) > 0) for one in strips]) for column in columns]
        self.columns(entity, times, *parted)

    def sightings(self, shots: Mapping[int, Shot]) -> None:
        rr, seen, views = self.rr, self.scene.sightings, self.scene.views
        if seen is None or views is None:
            return
        s = next(iter(shots.values())).scale if shots else 1.0
        order = np.argsort(seen.frame, kind="stable")
        counts = np.bincount(seen.frame, minlength=len(views.times))
        entity = "world/camera/image/detections"
        self.static(
            entity,
            rr.Points2D.from_fields(
                colors=[rgba(SIGHTING)], radii=rr.Radius.ui_points(6.0), show_labels=True
            ),
        )
        columns = rr.Points2D.columns(
            positions=(seen.uv[order] + 0.5) * s, labels=[plain(name) for name in seen.names[order]]
        )
        self.columns(entity, views.times, *(column.partition(counts) for column in columns))

    def points(self) -> None:
        rr, points = self.rr, self.scene.points
        if points is None:
            return
        times, counts = np.unique(points.times, return_counts=True)
        enu = ned_to_enu(points.places)
        self.static(
            "world/points/places",
            rr.Points3D.from_fields(colors=[rgba(SIGHTING)], radii=rr.Radius.ui_points(2.5)),
        )
        self.columns(
            "world/points/places",
            times,
            *(column.partition(counts) for column in rr.Points3D.columns(positions=enu)),
        )
        self._ellipses("world/points/ellipses", points, SIGHTING)
        if not self.scene.tracks:
            self._judged("detections", "detections", points, SIGHTING)

    def _ellipses(self, entity: str, of: Points | Estimates, colour: str) -> None:
        rr = self.rr
        known = np.isfinite(of.covariance).all(axis=(1, 2)) & np.isfinite(of.places).all(axis=1)
        self.static(
            entity, rr.LineStrips3D.from_fields(colors=[rgba(colour, 0.8)], radii=rr.Radius.ui_points(1.2))
        )
        if not known.any():
            return
        rings = ned_to_enu(ellipse_rings(of.places[known], of.covariance[known]))
        times, counts = np.unique(of.times[known], return_counts=True)
        columns = rr.LineStrips3D.columns(strips=list(rings))
        self.columns(entity, times, *(column.partition(counts) for column in columns))

    def _judged(self, part: str, name: str, of: Points | Estimates, colour: str) -> None:
        rr = self.rr
        for plot, values in (("error", of.error), ("nees", of.nees)):
            if not np.isfinite(values).any():
                continue
            entity = f"plots/{plot}/{part}"
            # The line is cut where nothing is known; single detections are dots.
            if isinstance(of, Points):
                self.static(
                    entity, rr.SeriesPoints(colors=[rgba(colour)], names=[plain(name)], marker_sizes=[2.5])
                )
            else:
                self.static(entity, rr.SeriesLines(colors=[rgba(colour)], names=[plain(name)], widths=[1.5]))
            self._scalars(entity, of.times, values)
            if plot == "nees":
                for label, bound in zip(("low", "high"), NEES_BAND, strict=True):
                    band = f"plots/nees/band_{label}"
                    self.static(
                        band, rr.SeriesLines(colors=[rgba(TRUTH, 0.5)], names=[f"95 % {label}"], widths=[1.0])
                    )
                    self._scalars(band, np.array([0.0, self.scene.length]), np.array([bound, bound]))

    def track(self, one: Estimates) -> None:
        rr = self.rr
        colour = of_filter(one.filter)
        base = f"world/tracks/{path_part(one.filter)}/{path_part(one.target)}/{path_part(one.sensor)}"
        enu = ned_to_enu(one.places)
        self.static(
            f"{base}/place",
            rr.Points3D.from_fields(
                colors=[rgba(colour)],
                radii=rr.Radius.ui_points(4.0),
                labels=[plain(one.filter)],
                show_labels=False,
            ),
        )
        self.columns(f"{base}/place", one.times, *rr.Points3D.columns(positions=enu))
        self._ellipses(f"{base}/ellipse", one, colour)
        self._judged(
            f"{path_part(one.filter)}/{path_part(one.target)}", f"{one.filter} {one.target}", one, colour
        )

    def truth(self) -> None:
        rr = self.rr
        still = [one for one in self.scene.truth if one.still]
        if still:
            self.static(
                "world/truth/fixed_points",
                rr.Points3D(
                    ned_to_enu(np.concatenate([one.places for one in still])),
                    colors=[rgba(TRUTH)],
                    radii=rr.Radius.ui_points(3.5),
                    labels=[plain(one.name) for one in still],
                    show_labels=len(still) <= 12,
                ),
            )
        moving = [one for one in self.scene.truth if not one.still]
        for one in moving:
            entity = f"world/truth/{path_part(one.name)}"
            enu = ned_to_enu(one.places)
            self.static(
                f"{entity}/path",
                rr.LineStrips3D([enu], colors=[rgba(TRUTH, 0.35)], radii=rr.Radius.ui_points(0.8)),
            )
            self.static(
                f"{entity}/now",
                rr.Points3D.from_fields(
                    colors=[rgba(TRUTH)],
                    radii=rr.Radius.ui_points(4.0),
                    labels=[plain(one.name)],
                    show_labels=len(moving) <= 12,
                ),
            )
            self.columns(f"{entity}/now", one.times, *rr.Points3D.columns(positions=enu))


def _corner(scene: ReplayScene) -> tuple[float, float]:
    assert scene.terrain is not None  # noqa: S101 - for the type checker
    return scene.terrain.north, scene.terrain.east


def _turned(R_nc: Array) -> Array:
    """Rotations into n as rotations into x east, y north, z up."""
    return np.stack([R_nc[:, 1], R_nc[:, 0], -R_nc[:, 2]], axis=1)
