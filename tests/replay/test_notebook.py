"""A flight inside a notebook: shown by rerun's widget where that is, else what to install is said."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import rerun.notebook as widgets

from wildlab.replay.recording import show_replay
from wildlab.simulation.twins import simulate_twin


def test_without_the_widget_it_is_said_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr(widgets, "HAS_NOTEBOOK", False)
    show_replay(simulate_twin("large-ship", 1))
    assert "rerun-sdk[notebook]" in capsys.readouterr().out


def test_the_widget_gets_the_flight(capsys, monkeypatch):
    given: dict[str, Any] = {}

    def viewer(**arguments: Any) -> Any:
        given.update(arguments)
        return SimpleNamespace(display=lambda: given.update(displayed=True))

    monkeypatch.setattr(widgets, "HAS_NOTEBOOK", True)
    monkeypatch.setattr(widgets, "Viewer", viewer)
    monkeypatch.delenv("RERUN_NOTEBOOK_ASSET", raising=False)
    show_replay(simulate_twin("large-ship", 1))
    assert given["displayed"] and given["recording"].get_recording_id() == "replay"
    assert capsys.readouterr().out == ""
