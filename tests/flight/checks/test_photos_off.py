"""A photo is called off beyond what stated errors allow for so many photos, and not for a wrong detection."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.sense.seen import _off, seen
from wildlab.flight.store import Flight
from wildlab.geometry.camera import project
from wildlab.geometry.frames import euler_to_matrix, matrix_to_quaternion
from wildlab.geometry.mount import camera_pose

Make = Callable[..., Flight]
STATED = {
    "pixel_px": 2.0,
    "position_horizontal_m": 1.0,
    "position_vertical_m": 1.0,
    "tilt_deg": 1.0,
    "heading_deg": 3.0,
}
CAMERA = {"name": "wide", "width_px": 640, "height_px": 512, "fx_px": 400.0, "fy_px": 400.0}
PHOTOS = 50


def watched(make: Make, seed: int, clutter: float = 0.0, leant: dict[int, float] | None = None) -> Flight:
    """Four collared animals in each of 50 photos from 100 m up, with poses as wrong as is stated.

    Which detection is of which is not told. `clutter`: share of detections of nothing known; `leant`: further
    errors of roll, deg, of some photos.
    """
    rng = np.random.default_rng(seed)
    flight = make(
        camera={**CAMERA, "cx_px": 320.0, "cy_px": 256.0},
        mount={"looks": "down"},
        uncertainty=STATED,
        scoring={"rule": "nearest"},
    )
    t = np.arange(PHOTOS) * 2.0
    p = np.column_stack([4.0 * np.sin(t), 4.0 * np.cos(t), np.full(PHOTOS, -100.0)])
    yaw = 0.1 * t
    error = rng.normal(0, np.radians([1.0, 1.0, 3.0]), (PHOTOS, 3))
    for photo, more in (leant or {}).items():
        error[photo, 0] += np.radians(more)
    measured = euler_to_matrix(*(error + np.column_stack([0 * t, 0 * t, yaw])).T)
    nav = pd.DataFrame({"frame_id": [f"P{k}" for k in range(PHOTOS)], "time_s": t})
    nav[["north_m", "east_m", "down_m"]] = p
    nav[["q_w", "q_x", "q_y", "q_z"]] = matrix_to_quaternion(measured)
    flight.nav.clear()
    flight.nav["log"] = nav
    flight.tables["frames"] = nav[["frame_id", "time_s"]]
    animals = np.array([[14.0, 10.0, 0.0], [-12.0, 14.0, 0.0], [-10.0, -15.0, 0.0], [13.0, -9.0, 0.0]])
    flight.tables["truth"] = pd.DataFrame(
        {"target_id": list("abcd"), "time_s": np.nan, "north_m": animals[:, 0], "east_m": animals[:, 1]}
    ).assign(down_m=0.0)
    zero = np.zeros(PHOTOS)
    where, R = camera_pose(flight.manifest.geometry_mount(), p, euler_to_matrix(zero, zero, yaw), zero, zero)
    seen_at = np.einsum("kji,kaj->kai", R, animals - where[:, None])
    uv = project(flight.manifest.geometry_camera(), seen_at) + rng.normal(0, 2.0, (PHOTOS, 4, 2))
    wrong = rng.random((PHOTOS, 4)) < clutter
    uv[wrong] = rng.uniform([0, 0], [640, 512], (int(wrong.sum()), 2))
    ids = nav["frame_id"].repeat(4).to_numpy()
    flight.tables["detections"] = pd.DataFrame(
        {"detection_id": [str(k) for k in range(len(ids))], "frame_id": ids, "source": "detector"}
    ).assign(kind="pixel", target_id="", u_px=uv[..., 0].ravel(), v_px=uv[..., 1].ravel(), plane_down_m=0.0)
    return flight


def off(flight: Flight) -> list[str]:
    return [one.sentence for one in seen(flight) if "one photo off" in one.causes]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("clutter", [0.0, 0.1, 0.25])
def test_a_flight_as_stated_has_no_photo_off(make_flight, seed, clutter):
    assert off(watched(make_flight, seed, clutter)) == []


def test_one_wrong_of_two_detections_is_no_wrong_photo(make_flight):
    flight = watched(make_flight, 1)
    detections = flight.table("detections")
    rows = np.flatnonzero(detections["frame_id"] == "P5")
    detections.loc[rows[0], ["u_px", "v_px"]] = 5.0
    flight.tables["detections"] = detections.drop(rows[2:]).reset_index(drop=True)
    assert off(flight) == []


@pytest.mark.parametrize("clutter", [0.0, 0.1])
def test_wrong_photos_are_still_named(make_flight, clutter):
    (said,) = off(watched(make_flight, 1, clutter, {7: 35.0, 31: -30.0}))
    assert re.findall(r"'(P\d+)'", said) == ["P7", "P31"]


def named(far: list[tuple[int, int]]) -> list[str]:
    """Of photos with so many far points of so many."""
    names = np.repeat([f"P{k}" for k in range(len(far))], [n for _, n in far]).astype(object)
    rows = np.concatenate([np.arange(n) < some for some, n in far])
    return _off(rows, names, np.full(len(rows), True))


def test_half_of_the_points_are_no_wrong_photo():
    assert named([(1, 2)] + [(0, 4)] * 20) == []
    assert named([(2, 4)] + [(0, 4)] * 20) == []
    assert named([(3, 4)] + [(0, 4)] * 20) == ["P0"]


def test_what_far_ones_do_by_chance_is_no_wrong_photo():
    """A tenth of all points far: in 100 photos of two points both are so in one, by chance."""
    usual = [(1, 2)] * 20 + [(0, 2)] * 80
    assert named([(2, 2), *usual]) == []
    assert named([(8, 8), *usual]) == ["P0"]
    # Where no other is far, two of two are enough.
    assert named([(2, 2)] + [(0, 4)] * 20) == ["P0"]
