"""How rerun's viewer lays a scene out: the map in three dimensions, the image, plots, and words."""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.replay.scene import Scene

#: Seconds for which ellipses of single detections stay, and playback takes for a long flight, at least.
STAY_S, PLAYED_S = 10.0, 120.0


def blueprint_of(scene: Scene) -> Any:
    """The layout of a scene, with rerun's panels folded but for the time line."""
    import rerun.blueprint as rrb

    line = "flight_time" if scene.timed else "image"
    now = rrb.TimeRangeBoundary.cursor_relative()
    if scene.timed:
        recent = rrb.TimeRangeBoundary.cursor_relative(seconds=-STAY_S)
    else:
        recent = rrb.TimeRangeBoundary.cursor_relative(seq=-3)
    since = rrb.TimeRangeBoundary.infinite()
    low, high = scene.extent
    middle, size = (low + high) / 2, max(float(np.linalg.norm((high - low)[:2])), 10.0)
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
    body: list[Any] = [
        rrb.Horizontal(*views, rrb.Vertical(*right, row_shares=[3, 2][: len(right)]), column_shares=[3, 2])
    ]
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


def _plots(rrb: Any, scene: Scene) -> list[Any]:
    edge = rrb.TimeRangeBoundary
    margin = 0.02 * scene.length
    whole = rrb.TimeRange(
        start=edge.absolute(seconds=-margin) if scene.timed else edge.absolute(seq=0),
        end=edge.absolute(seconds=scene.length + margin)
        if scene.timed
        else edge.absolute(seq=int(scene.length)),
    )
    axis_x = rrb.TimeAxis(view_range=whole)
    judged = scene.tracks or ((scene.points,) if scene.points is not None else ())
    found = []
    if any(np.isfinite(one.error).any() for one in judged):
        found.append(rrb.TimeSeriesView(origin="/plots/error", name="Error (m)", axis_x=axis_x))
    nees = [one.nees[np.isfinite(one.nees)] for one in judged]
    values = np.concatenate(nees) if nees else np.empty(0)
    if len(values):
        # A few large ones would press all others flat; they are there when the plot is moved.
        top = max(12.0, 1.2 * float(np.quantile(values, 0.95)))
        axis = rrb.ScalarAxis(range=(0.0, top))
        found.append(
            rrb.TimeSeriesView(
                origin="/plots/nees", name="NEES, and its 95 % band", axis_y=axis, axis_x=axis_x
            )
        )
    if scene.path is not None:
        found.append(
            rrb.TimeSeriesView(origin="/plots/height", name="Height above ground (m)", axis_x=axis_x)
        )
    return found
