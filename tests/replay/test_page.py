"""The page that plays a flight: its numbers are the scene's, it may do nothing else, and it moves."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from wildlab.flight.clocks import longest_gap
from wildlab.geometry.georeference import Terrain
from wildlab.replay import scene as scenes
from wildlab.replay.page import drawn, page
from wildlab.replay.scene import (
    Estimates,
    Points,
    ReplayScene,
    Sightings,
    Target,
    Views,
)

HOSTILE = "</script><script>alert(1)//<!--\u202e"


def scene_of_a_minute(name: str = HOSTILE) -> ReplayScene:
    """An aircraft that goes north at 10 m/s, and a target that is seen every second."""
    t = np.arange(61.0)
    way = np.column_stack([10 * t, 0 * t, -100 + 0 * t])
    target = np.column_stack([300 + 0 * t, 2 * t, 0 * t])
    P = np.tile([[9.0, 2.0], [2.0, 4.0]], (61, 1, 1))
    P[7] = np.nan
    error, nees = 0.1 * t, np.where(t > 50, np.nan, 1.0)
    outlines = way[:, None, :2] + 50 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(16) * np.pi / 8])
    outlines[5] = np.nan
    names = np.full(61, name, object)
    height = np.linspace(0, 20, 900).reshape(30, 30).astype(np.float32)
    height[0, 0] = np.nan
    return ReplayScene(
        name=name,
        kind="logged",
        timed=True,
        path=scenes.Path(t, way, name),
        views=Views(names, t, outlines),
        sightings=Sightings(np.arange(61), np.column_stack([t, t]), names),
        points=Points(t, target + 1, P, names, error, nees),
        tracks=(Estimates(name, name, name, t, target - 1, P, error, nees),),
        truth=(Target(name, t, target), Target("post", np.array([np.nan]), target[:1])),
        terrain=Terrain(height, north=0.0, east=-100.0, step=20.0),
        lacks=(name,),
    )


def shots(count: int) -> dict[int, bytes]:
    grey = np.random.default_rng(1).integers(0, 255, (120, 160), np.uint8)
    return {row: cv2.imencode(".jpg", grey)[1].tobytes() for row in range(count)}


def test_it_holds_the_scenes_numbers():
    scene = scene_of_a_minute("boat")
    found = json.loads(json.dumps(drawn(scene, shots(3)), allow_nan=False))
    assert scene.path is not None and scene.points is not None
    assert np.allclose(found["path"]["p"], scene.path.places[:, :2], atol=0.005)
    assert np.allclose(found["points"]["p"], scene.points.places[:, :2], atol=0.005)
    assert found["points"]["ellipses"][7] == [None] * 3 and found["tracks"][0]["nees"][55] is None
    assert found["frames"]["outlines"][5][0] == [None, None] and len(found["frames"]["outlines"][4]) == 8
    assert [one["still"] for one in found["truth"]] == [False, True]
    assert [row for row, _ in found["pictures"]] == [0, 1, 2]
    assert found["band"] == pytest.approx([0.0506, 7.378], abs=1e-3)
    assert found["path"]["gap"] == longest_gap(np.arange(61.0))
    assert found["ground"]["extent"] == [0.0, -100.0, 580.0, 480.0]


def test_half_axes_and_turn_are_those_of_the_covariance():
    scene = scene_of_a_minute("boat")
    assert scene.points is not None
    (a, b, turn), P = drawn(scene, {})["points"]["ellipses"][0], scene.points.covariance[0]
    angle = np.linspace(0, 2 * np.pi, 400)
    # As a browser draws it: x to the east, y to the south, turned clockwise.
    x = a * np.cos(angle) * np.cos(turn) - b * np.sin(angle) * np.sin(turn)
    y = a * np.cos(angle) * np.sin(turn) + b * np.sin(angle) * np.cos(turn)
    offset = np.column_stack([-y, x])
    assert np.allclose(np.einsum("ki,ij,kj->k", offset, np.linalg.inv(P), offset), 4.605, rtol=0.02)


def test_a_flight_that_has_truth_alone_lasts_as_long():
    scene = scene_of_a_minute("boat")
    alone = replace(scene, path=None, views=None, sightings=None, points=None, tracks=())
    assert alone.length == 60.0
    # Minutes between two fixes are not a straight way.
    t, p = np.array([0.0, 1.0, 2.0, 600.0, 601.0]), np.zeros((5, 3))
    assert 1 < drawn(replace(scene, truth=(Target("boat", t, p),)), {})["truth"][0]["gap"] < 598


def test_names_do_nothing_and_nothing_is_asked_for():
    text = page(scene_of_a_minute(), shots(2))
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy is not None
    rules = dict(part.strip().split(" ", 1) for part in policy[1].split(";"))
    assert rules["default-src"] == "'none'" and "connect-src" not in rules and "unsafe" not in policy[1]
    scripts = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    hashes = [base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts]
    assert len(scripts) == 1 and rules["script-src"] == f"'sha256-{hashes[0]}'"
    assert text.count("</script>") == 2 and "<script>alert" not in text and "\u202e" not in text
    assert not re.search(r"""(?:src|href)=(?!["']data:)""", text)


def many(scene: ReplayScene) -> ReplayScene:
    """The same with three targets, each by three filters."""
    (one,) = scene.tracks
    names = [(target, name) for target in ("a", "<b>", "c") for name in ("ekf", "ukf", "imm")]
    return replace(scene, tracks=tuple(one._replace(target=a, filter=b) for a, b in names))


def test_of_many_tracks_those_of_one_filter_are_shown_first():
    few, text = page(scene_of_a_minute("x"), {}), page(many(scene_of_a_minute("x")), {})
    assert "<option selected>white noise (EKF)</option>" in text and "<option>&lt;b&gt;</option>" in text
    assert "selected" not in few and few.count("<label hidden>") == 2
    tracks = drawn(many(scene_of_a_minute("x")), {})["tracks"]
    assert {(one["target"], one["filter"]) for one in tracks} >= {("<b>", "white noise (UKF)")}


def test_tracks_are_chosen_and_panels_are_high_enough_to_be_read(browser: Any, tmp_path):
    file = tmp_path / "replay.html"
    file.write_text(page(many(scene_of_a_minute("x")), {}), encoding="utf-8")
    for width in (400, 1200):
        opened = browser.new_page(viewport={"width": width, "height": 800})
        opened.goto(file.as_uri())
        assert opened.evaluate("shownTracks().length") == 3
        opened.select_option("#target", "<b>")
        assert opened.evaluate("shownTracks().map(one => one.target + one.filter)") == [
            "<b>white noise (EKF)"
        ]
        opened.select_option("#filter", "")
        assert opened.evaluate("shownTracks().length") == 3
        assert opened.locator("#strips").bounding_box()["height"] > 3 * 120
        opened.close()


def test_it_plays_and_zooms_in_a_browser(browser: Any, faults: Callable[[Path], list[str]], tmp_path):
    file = tmp_path / "replay.html"
    file.write_text(page(scene_of_a_minute(), shots(61)), encoding="utf-8")
    assert faults(file) == []
    context = browser.new_context(viewport={"width": 1000, "height": 800}, offline=True)
    opened = context.new_page()
    broken: list[str] = []
    opened.on("pageerror", lambda error: broken.append(str(error)))
    opened.goto(file.as_uri())
    # North is up and east to the right; between two places lies their mean, and nothing where there is a gap.
    (x, y), (right, _), (_, up) = (
        opened.evaluate(f"view(500, 400)[1]({place})") for place in ("[0, 0]", "[0, 9]", "[9, 0]")
    )
    assert right > x and up < y and right - x == pytest.approx(y - up)
    assert opened.evaluate("place({t: [0, 1], p: [[0, 0], [4, 8]], gap: 5}, 0.25)") == [1, 2]
    assert opened.evaluate("place({t: [0, 99], p: [[0, 0], [4, 8]], gap: 5}, 50)") is None
    assert opened.evaluate("last([0, 1, 1, 3], 1)") == 2 and opened.evaluate("last([1], 0)") == -1
    pictures = [opened.locator("#map").screenshot()]
    opened.locator("#time").fill("30")
    pictures.append(opened.locator("#map").screenshot())
    opened.click("#closer")
    pictures.append(opened.locator("#map").screenshot())
    opened.click("#play")
    opened.wait_for_timeout(700)
    opened.click("#play")
    assert 30 < float(opened.locator("#time").input_value()) < 60
    opened.locator("#strips").click(position={"x": 8, "y": 40})
    assert float(opened.locator("#time").input_value()) == pytest.approx(0, abs=0.5)
    context.close()
    assert broken == [] and len(set(pictures)) == 3
