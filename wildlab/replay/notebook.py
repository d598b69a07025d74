"""A flight in rerun's viewer inside a notebook, where the viewer's widget is installed."""

from __future__ import annotations

import os

from wildlab.flight.store import Flight
from wildlab.replay.gather import scene_of
from wildlab.replay.recording import log_scene

#: What to say where the widget is missing.
INSTALL = (
    "To play the flight back here, install rerun's widget, pip install 'rerun-sdk[notebook]==0.41.*', and "
    'start the kernel anew. Without it: save_flight(flight, "flights/mine"), and then in a terminal '
    "wildlab replay flights/mine --html."
)


def show_replay(flight: Flight, source: str | None = None) -> None:
    """Show a flight in rerun's viewer below the cell, or say what to install.

    Parameters
    ----------
    flight
        With anything missing; what lacks is said in the viewer.
    source
        Name of the ``nav`` table; left out, the best known one.

    Raises
    ------
    WildlabError
        Where a source is named that the flight has not, or there is nothing that could be shown.
    """
    scene = scene_of(flight, source)
    # The widget else gets its viewer from the network.
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "inline")
    import rerun.notebook as widgets

    if not widgets.HAS_NOTEBOOK:
        print(INSTALL)
        return
    from wildlab.replay.blueprint import blueprint_of

    stream = log_scene(scene)
    widgets.Viewer(width=960, height=640, recording=stream, blueprint=blueprint_of(scene)).display()
