"""How rerun's viewer lays a scene out: the map in three dimensions, the image, plots, and words."""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.replay.scene import ReplayScene, heights

#: Seconds for which ellipses of single detections stay, and playback takes for a long flight, at least.
STAY_S, PLAYED_S = 10.0, 120.0


def blueprint_of(scene: ReplayScene, *, narrow: bool = False) -> Any:
    """The layout of a scene, with rerun's panels folded but for the time line.

    Parameters
    ----------
    scene
        From `wildlab.replay.gather.scene_of`.
    narrow
        For a phone held upright: the map, and below it all else in tabs.
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
    if narrow:
        # The words first: nothing else says what it is.
        body: list[Any] = [*views, rrb.Tabs(*right[::-1], *plots, active_tab=0)]
        shares = [3, 2]
    else:
        beside = rrb.Vertical(*right, row_shares=[3, 2][: len(right)])
        body = [rrb.Horizontal(*views, beside, column_shares=[3, 2])]
        shares = [7, 3]
        if plots:
            body.append(rrb.Horizontal(*plots))
    speed = max(1.0, round(scene.length / PLAYED_S)) if scene.timed else 1.0
    return rrb.Blueprint(
        rrb.Vertical(*body, row_shares=shares[: len(body)]),
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
