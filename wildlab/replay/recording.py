"""A scene as a rerun recording, with its views, the words beside them, and the colours of the reports."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from wildlab.flight.store import Flight
from wildlab.geometry.frames import ned_to_enu
from wildlab.replay.images import Shot
from wildlab.replay.scene import (
    Array,
    Estimates,
    Path,
    Points,
    ReplayScene,
    Target,
    _visible,
    ellipse_rings,
    heights,
    mesh,
    minutes,
    plain,
    scene_of,
)
from wildlab.reporting.figures import BLUE, GREY, ORANGE, colour

FLOWN, VIEW, SIGHTING, TRUTH, GROUND = BLUE, "#1b7f79", ORANGE, "#111111", "#d8e6ee"


def rgba(colour: str, alpha: float = 1.0) -> tuple[int, int, int, int]:
    """``#rrggbb`` as four numbers to 255.

    Examples
    --------
    >>> rgba("#ff8000", 0.5)
    (255, 128, 0, 128)
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue, round(255 * alpha)


def of_filter(name: str) -> str:
    """The colour that reports give a filter; grey where they know none."""
    found = colour(name)
    return found if found.startswith("#") and len(found) == 7 else GREY


def in_markdown(name: str) -> str:
    """A name in a text that is Markdown: a link, a picture, a heading or HTML in it stays letters.

    Examples
    --------
    >>> in_markdown("![a](http://b)")
    '\\\\!\\\\[a\\\\]\\\\(http\\\\:\\\\/\\\\/b\\\\)'
    """
    return re.sub(r"([!-/:-@\[-`{-~])", r"\\\1", plain(name))


def path_part(name: str) -> str:
    """A name as one part of an entity's path.

    Examples
    --------
    >>> path_part("a/b c"), path_part("")
    ('a\\\\/b\\\\ c', 'no name')
    """
    import rerun_bindings

    return str(rerun_bindings.escape_entity_path_part(plain(name))) or "no name"


def about_scene(scene: ReplayScene, pictures: int) -> str:
    """The panel of words beside the views, as Markdown."""
    shown = []
    if scene.path is not None:
        shown.append(f"**blue**: the aircraft and its way, poses of *{in_markdown(scene.path.source)}*")
    if scene.views is not None:
        posed = "**green-blue**: the camera and what it sees of the ground"
        shown.append(f"{posed}, {len(scene.views.times)} frames")
    if pictures:
        shown.append(f"{pictures} images, reduced")
    if scene.sightings is not None and len(scene.sightings.frame):
        shown.append(f"**orange**: {len(scene.sightings.frame)} detections in the images")
    if scene.points is not None:
        shown.append(f"**orange**: {len(scene.points.times)} detections on the ground, with 90 % ellipses")
    for name in dict.fromkeys(one.filter for one in scene.tracks):
        count = sum(one.filter == name for one in scene.tracks)
        of = "track" if count == 1 else "tracks"
        shown.append(f"{count} {of} by the filter *{in_markdown(name)}*, with 90 % ellipses")
    if scene.truth:
        count = len(scene.truth)
        shown.append(f"**black**: where {count} {'target' if count == 1 else 'targets'} really were")
    ground = "terrain" if scene.terrain is not None else "level ground" if isfinite(scene.ground) else ""
    shown += [ground] if ground else []
    flight = "a simulated flight" if scene.kind == "twin" else "a recorded flight"
    time = f"lasts {minutes(scene.length)}" if scene.timed else "its times number the images"
    lines = [
        f"# {in_markdown(scene.name)}",
        "",
        f"This is {flight}; it {time}." if scene.timed else f"This is {flight}; {time}.",
        "",
        "Shown:",
        "",
        *(f"- {one}" for one in shown),
    ]
    if scene.lacks:
        lines += ["", "Not shown:", "", *(f"- {_clause(one)}" for one in scene.lacks)]
    lines += ["", "Lengths are metres; x is east, y north, z up. Where on Earth this is it does not say."]
    return "\n".join(lines) + "\n"


def _clause(text: str) -> str:
    return re.sub(r"([!-&(-+/<-@\[-`{-~])", r"\\\1", "".join(c for c in text if c.isspace() or _visible(c)))


#: Seconds for which ellipses of single detections stay, and playback takes for a long flight, at least.
STAY_S, PLAYED_S = 10.0, 120.0


def blueprint_of(scene: ReplayScene) -> Any:
    """The layout of a scene, with rerun's panels folded but for the time line.

    Parameters
    ----------
    scene
        From `wildlab.replay.scene.scene_of`.
    """
    import rerun.blueprint as rrb

    line = "flight_time" if scene.timed else "image"
    now = rrb.TimeRangeBoundary.cursor_relative()
    if scene.timed:
        recent = rrb.TimeRangeBoundary.cursor_relative(seconds=-STAY_S)
    else:
        recent = rrb.TimeRangeBoundary.cursor_relative(seq=-3)
    since = rrb.TimeRangeBoundary.infinite()
    low, high = scene.extent
    middle, size = (
        (low + high) / 2,
        max(float(np.linalg.norm((high - low)[:2])) + 1.2 * float(high[2] - low[2]), 10.0),
    )
    target = np.array([middle[1], middle[0], -high[2]])
    views: list[Any] = [
        rrb.Spatial3DView(
            origin="/world",
            name="Map, from above",
            background=rrb.Background(color=(246, 248, 249)),
            line_grid=rrb.LineGrid3D(visible=False),
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital,
                position=target + size * np.array([0.0, -0.35, 0.75]),
                look_target=target,
                eye_up=(0.0, 0.0, 1.0),
            ),
            overrides={
                "world/points/places": rrb.VisibleTimeRanges(timeline=line, start=since, end=now),
                "world/points/ellipses": rrb.VisibleTimeRanges(timeline=line, start=recent, end=now),
            },
        )
    ]
    right: list[Any] = []
    if scene.views is not None:
        right.append(
            rrb.Spatial2DView(
                origin="/world/camera/image",
                name="Image",
                background=rrb.Background(color=(246, 248, 249)),
            )
        )
    right.append(rrb.TextDocumentView(origin="/about", name="What is shown"))
    plots = _plots(rrb, scene)
    beside = rrb.Vertical(*right, row_shares=[3, 2][: len(right)])
    body: list[Any] = [rrb.Horizontal(*views, beside, column_shares=[3, 2])]
    if plots:
        body.append(rrb.Horizontal(*plots))
    speed = max(1.0, round(scene.length / PLAYED_S)) if scene.timed else 1.0
    return rrb.Blueprint(
        rrb.Vertical(*body, row_shares=[7, 3][: len(body)]),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(
            state="collapsed", timeline=line, playback_speed=speed, play_state="playing", loop_mode="all"
        ),
        auto_layout=False,
        auto_views=False,
    )


def _plots(rrb: Any, scene: ReplayScene) -> list[Any]:
    edge = rrb.TimeRangeBoundary
    if scene.timed:
        margin = 0.02 * scene.length
        ends = edge.absolute(seconds=-margin), edge.absolute(seconds=scene.length + margin)
    else:
        ends = edge.absolute(seq=0), edge.absolute(seq=int(scene.length))
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(start=ends[0], end=ends[1]))

    def plot(part: str, name: str, top: float) -> Any:
        return rrb.TimeSeriesView(
            origin=f"/plots/{part}",
            name=name,
            axis_x=whole,
            axis_y=rrb.ScalarAxis(range=(0.0, top)),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        )

    judged = scene.tracks or ((scene.points,) if scene.points is not None else ())
    errors = _known([one.error for one in judged])
    nees = _known([one.nees for one in judged])
    found = []
    # A few large values would press all others flat; they are there when the plot is moved.
    if len(errors):
        found.append(plot("error", "Error (m)", 1.3 * max(float(np.quantile(errors, 0.98)), 1e-3)))
    if len(nees):
        found.append(plot("nees", "NEES, and its 95 % band", max(12.0, 1.2 * float(np.quantile(nees, 0.95)))))
    if scene.path is not None:
        highest = float(heights(scene).max())
        found.append(plot("height", "Height above ground (m)", 1.2 * max(highest, 1.0)))
    return found


def _known(parts: list[Any]) -> Any:
    values = np.concatenate(parts) if parts else np.empty(0)
    return values[np.isfinite(values)]


#: Whose layouts and recordings belong together.
APPLICATION = "wildlab replay"
Colour = tuple[int, int, int, int]
#: What to say where the widget is missing.
INSTALL = (
    "To play the flight back here, install rerun's widget, pip install 'rerun-sdk[notebook]==0.41.*', and "
    'start the kernel anew. Without it: save_flight(flight, "flights/mine"), and then in a terminal '
    "wildlab replay flights/mine."
)
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
        From `wildlab.replay.scene.scene_of`.
    into
        The file; what is there is replaced.
    shots
        Pictures by the row of the scene's views.
    tell
        Is told what is being written.
    """
    # Before rerun is imported: nothing of this is counted by anybody.
    import rerun as rr

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


def log_scene(scene: ReplayScene) -> Any:
    """A scene as a stream of rerun that a widget shows; nothing is written.

    Parameters
    ----------
    scene
        From `wildlab.replay.scene.scene_of`.

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
        self.static(
            "about", self.rr.TextDocument(about_scene(self.scene, len(shots)), media_type="text/markdown")
        )
        self.static("world", self.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        tell("the ground")
        self.ground()
        tell("the aircraft")
        self.path()
        tell("what the camera saw")
        scale = next(iter(shots.values())).scale if shots else 1.0
        self.camera(scale)
        self.images(shots)
        self.sightings(scale)
        tell("points and tracks")
        self.points()
        for one in self.scene.tracks:
            self.track(one)
        self.truth()

    # -- how things are logged
    # ------------------------------------------------------------------------------------

    def static(self, entity: str, *what: Any) -> None:
        self.stream.log(entity, *what, static=True, strict=True)

    def style(self, entity: str, kind: Any, colour: Colour, points: float, **more: Any) -> None:
        """Give an entity of a kind its colour and its size on the screen."""
        radii = self.rr.Radius.ui_points(points)
        self.static(entity, kind.from_fields(colors=[colour], radii=radii, **more))

    def columns(self, entity: str, times: Array, columns: Any, counts: Any = None) -> None:
        """What an entity has at each time: one row, or as many as ``counts`` says."""
        if not len(times):
            return
        if self.scene.timed:
            at = self.rr.TimeColumn(SECONDS, duration=np.asarray(times, float))
        else:
            at = self.rr.TimeColumn(IMAGES, sequence=np.asarray(times).round().astype(np.int64))
        parted = columns if counts is None else [column.partition(counts) for column in columns]
        self.stream.send_columns(entity, [at], list(parted), strict=True)

    def places(self, entity: str, times: Array, places: Array) -> None:
        """Where an entity is, of which several may be at one time."""
        at, counts = np.unique(times, return_counts=True)
        self.columns(entity, at, self.rr.Points3D.columns(positions=ned_to_enu(places)), counts)

    def dot(
        self, entity: str, colour: Colour, points: float, of: Path | Target | Estimates, **label: Any
    ) -> None:
        """A dot that moves; its label is shown where that is asked for."""
        self.style(entity, self.rr.Points3D, colour, points, **{"show_labels": False} | label)
        self.columns(entity, of.times, self.rr.Points3D.columns(positions=ned_to_enu(of.places)))

    def way(self, entity: str, places: Array, colour: Colour, points: float) -> None:
        radii = self.rr.Radius.ui_points(points)
        self.static(entity, self.rr.LineStrips3D([ned_to_enu(places)], colors=[colour], radii=radii))

    def series(self, entity: str, times: Array, values: Array, look: Any) -> None:
        """A plot over time; its line is cut where nothing is known."""
        self.static(entity, look)
        known = np.isfinite(values) & np.isfinite(times)
        self.columns(entity, times[known], self.rr.Scalars.columns(scalars=values[known]))

    # -- what there is
    # ------------------------------------------------------------------------------------

    def ground(self) -> None:
        scene = self.scene
        if scene.terrain is not None:
            place = scene.terrain.north, scene.terrain.east, scene.terrain.step
            vertices, triangles, colours, normals = mesh(scene.terrain.height, *place)
            surface = self.rr.Mesh3D(
                vertex_positions=vertices,
                triangle_indices=triangles,
                vertex_colors=colours,
                vertex_normals=normals,
            )
            self.static("world/terrain", surface)
        elif np.isfinite(scene.ground):
            low, high = scene.extent
            (n, e), (N, E) = low[:2] - 0.1 * self.size, high[:2] + 0.1 * self.size
            corners = np.column_stack([[n, n, N, N], [e, E, E, e], np.full(4, scene.ground)])
            # A little below what lies on it, which would flicker in it.
            corners = ned_to_enu(corners) - np.array([0.0, 0.0, 0.003 * self.size])
            surface = self.rr.Mesh3D(
                vertex_positions=corners,
                triangle_indices=[[0, 1, 2], [0, 2, 3]],
                vertex_colors=[rgba(GROUND)] * 4,
            )
            self.static("world/ground", surface)

    def path(self) -> None:
        path = self.scene.path
        if path is None:
            return
        self.way("world/flown/path", path.places, rgba(FLOWN, 0.45), 1.0)
        self.dot("world/flown/aircraft", rgba(FLOWN), 6.0, path, labels=["aircraft"])
        look = self.rr.SeriesLines(colors=[rgba(FLOWN)], names=["height (m)"], widths=[1.5])
        self.series("plots/height/aircraft", path.times, heights(self.scene), look)

    def camera(self, s: float) -> None:
        """The camera, its image's border and its footprints; ``s`` is by what images are made smaller."""
        rr, views, camera = self.rr, self.scene.views, self.scene.camera
        if views is None or camera is None:
            return
        w, h = camera.width * s, camera.height * s
        self.static(
            "world/camera/image",
            rr.Pinhole(
                focal_length=(camera.fx * s, camera.fy * s),
                principal_point=((camera.cx + 0.5) * s, (camera.cy + 0.5) * s),
                resolution=(w, h),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.06 * self.size,
                color=rgba(VIEW),
                line_width=rr.Radius.ui_points(1.5),
            ),
        )
        frame = rr.Boxes2D(
            mins=[[0, 0]], sizes=[[w, h]], colors=[rgba(VIEW, 0.6)], radii=rr.Radius.ui_points(1.0)
        )
        self.static("world/camera/image/border", frame)
        posed = np.isfinite(views.p_nc).all(axis=1) & np.isfinite(views.R_nc).all(axis=(1, 2))
        R = views.R_nc[posed]
        # Into x east, y north, z up.
        turned = np.stack([R[:, 1], R[:, 0], -R[:, 2]], axis=1)
        moved = rr.Transform3D.columns(translation=ned_to_enu(views.p_nc[posed]), mat3x3=turned)
        self.columns("world/camera", views.times[posed], moved)
        self.style("world/footprint", rr.LineStrips3D, rgba(VIEW), 2.0)
        placed = np.isfinite(views.outlines).all(axis=(1, 2))
        if placed.any():
            # Closed; none where part of the image looks past the ground.
            rings = np.concatenate([views.outlines, views.outlines[:, :1]], axis=1)[placed]
            strips = rr.LineStrips3D.columns(strips=[ned_to_enu(ring) for ring in rings])
            self.columns("world/footprint", views.times, strips, placed.astype(int))

    def images(self, shots: Mapping[int, Shot]) -> None:
        views = self.scene.views
        if views is None or not shots:
            return
        rows = sorted(shots)
        self.static("world/camera/image", self.rr.EncodedImage.from_fields(media_type="image/jpeg"))
        blobs = self.rr.EncodedImage.columns(blob=[shots[row].jpeg for row in rows])
        self.columns("world/camera/image", views.times[rows], blobs)

    def sightings(self, s: float) -> None:
        seen, views = self.scene.sightings, self.scene.views
        if seen is None or views is None:
            return
        order = np.argsort(seen.frame, kind="stable")
        entity = "world/camera/image/detections"
        self.style(entity, self.rr.Points2D, rgba(SIGHTING), 6.0, show_labels=True)
        names = [plain(name) for name in seen.names[order]]
        columns = self.rr.Points2D.columns(positions=(seen.uv[order] + 0.5) * s, labels=names)
        self.columns(entity, views.times, columns, np.bincount(seen.frame, minlength=len(views.times)))

    def points(self) -> None:
        points = self.scene.points
        if points is None:
            return
        self.style("world/points/places", self.rr.Points3D, rgba(SIGHTING), 2.5)
        self.places("world/points/places", points.times, points.places)
        self.ellipses("world/points/ellipses", points, SIGHTING)
        if not self.scene.tracks:
            self.judged("detections", "detections", points, SIGHTING)

    def track(self, one: Estimates) -> None:
        colour = of_filter(one.filter)
        path = "/".join(path_part(part) for part in (one.filter, one.target))
        base = f"world/tracks/{path}/{path_part(one.sensor)}"
        self.dot(f"{base}/place", rgba(colour), 4.0, one, labels=[plain(one.filter)])
        self.ellipses(f"{base}/ellipse", one, colour)
        self.judged(path, plain(f"{one.filter} {one.target}"), one, colour)

    def ellipses(self, entity: str, of: Points | Estimates, colour: str) -> None:
        known = np.isfinite(of.covariance).all(axis=(1, 2)) & np.isfinite(of.places).all(axis=1)
        self.style(entity, self.rr.LineStrips3D, rgba(colour, 0.8), 1.2)
        if known.any():
            rings = ned_to_enu(ellipse_rings(of.places[known], of.covariance[known]))
            times, counts = np.unique(of.times[known], return_counts=True)
            self.columns(entity, times, self.rr.LineStrips3D.columns(strips=list(rings)), counts)

    def judged(self, part: str, name: str, of: Points | Estimates, colour: str) -> None:
        """Errors and NEES over time, with the band of single values; single detections are dots."""
        rr, shown = self.rr, {"colors": [rgba(colour)], "names": [name]}
        for plot, values in (("error", of.error), ("nees", of.nees)):
            if np.isfinite(values).any():
                dots = isinstance(of, Points)
                look = (
                    rr.SeriesPoints(**shown, marker_sizes=[2.5])
                    if dots
                    else rr.SeriesLines(**shown, widths=[1.5])
                )
                self.series(f"plots/{plot}/{part}", of.times, values, look)
        for label, bound in (
            zip(("low", "high"), NEES_BAND, strict=True) if np.isfinite(of.nees).any() else ()
        ):
            look = rr.SeriesLines(colors=[rgba(TRUTH, 0.5)], names=[f"95 % {label}"], widths=[1.0])
            self.series(
                f"plots/nees/band_{label}", np.array([0.0, self.scene.length]), np.full(2, bound), look
            )

    def truth(self) -> None:
        still = [one for one in self.scene.truth if one.still]
        moving = [one for one in self.scene.truth if not one.still]
        if still:
            self.static(
                "world/truth/fixed_points",
                self.rr.Points3D(
                    ned_to_enu(np.concatenate([one.places for one in still])),
                    colors=[rgba(TRUTH)],
                    radii=self.rr.Radius.ui_points(3.5),
                    labels=[plain(one.name) for one in still],
                    show_labels=len(still) <= 12,
                ),
            )
        for one in moving:
            entity = f"world/truth/{path_part(one.name)}"
            self.way(f"{entity}/path", one.places, rgba(TRUTH, 0.35), 0.8)
            label = {"labels": [plain(one.name)], "show_labels": len(moving) <= 12}
            self.dot(f"{entity}/now", rgba(TRUTH), 4.0, one, **label)


def show_replay(flight: Flight) -> None:
    """Show a flight in rerun's viewer below the cell, or say what to install.

    Parameters
    ----------
    flight
        With anything missing; what lacks is said in the viewer.

    Raises
    ------
    WildlabError
        Where there is nothing that could be shown.
    """
    scene = scene_of(flight, None)
    # The widget else gets its viewer from the network.
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "inline")
    import rerun.notebook as widgets

    if not widgets.HAS_NOTEBOOK:
        print(INSTALL)
        return
    stream = log_scene(scene)
    widgets.Viewer(width=960, height=640, recording=stream, blueprint=blueprint_of(scene)).display()
