"""A replay read back and held against the flight's own numbers and geometry; and whatever a flight lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from tests.replay.recordings import Logged, read_recording
from wildlab.analysis.image_coverage import ground_height
from wildlab.flight.clocks import frame_poses, frame_times, gimbal_angles
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry import CameraPoses, Terrain, inside_ellipse, project
from wildlab.geometry.georeference import georeference_pixels
from wildlab.replay.images import Shot
from wildlab.replay.recording import save_recording
from wildlab.replay.scene import ellipse_rings, footprints, mesh, scene_of
from wildlab.simulation.twins import simulate_twin

ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture(scope="module")
def ship() -> Flight:
    return simulate_twin("large-ship", 1)


def saved(flight: Flight, folder: Path, **more: object) -> dict[tuple[str, str], Logged]:
    save_recording(scene_of(flight), folder / "replay.rrd", **more)  # type: ignore[arg-type]
    return read_recording(folder / "replay.rrd")


def single(found: Logged) -> np.ndarray:
    """(N, K) where each time has one instance."""
    return np.array([one[0] for one in found.values], float)


def poses_of(flight: Flight, source: str) -> CameraPoses:
    p, R, _ = frame_poses(flight, source)
    m = flight.manifest
    return CameraPoses(m.geometry_camera(), m.geometry_mount(), p, R, *gimbal_angles(flight))


def test_places_times_and_attitudes_are_those_of_the_flight(ship, tmp_path):
    found = saved(ship, tmp_path)
    nav = ship.nav["autopilot"]
    begin = nav["time_s"].iloc[0]
    aircraft = found["/world/flown/aircraft", "Points3D:positions"]
    at = np.searchsorted(nav["time_s"], aircraft.times + begin + 1e-6) - 1
    assert np.allclose(nav["time_s"].to_numpy()[at] - begin, aircraft.times, atol=2e-9)
    n, e, d = (nav[f"{name}_m"].to_numpy()[at] for name in ("north", "east", "down"))
    assert np.allclose(single(aircraft), np.stack([e, n, -d], axis=1), atol=1e-3)
    assert aircraft.times[0] == 0
    poses = poses_of(ship, "autopilot")
    moved = found["/world/camera", "Transform3D:translation"]
    stamps = frame_times(ship) - begin
    row = np.array([int(np.abs(stamps - t).argmin()) for t in moved.times])
    assert np.allclose(stamps[row], moved.times, atol=1e-6)
    assert np.allclose(single(moved), poses.p_nc[row] @ ENU.T, atol=1e-3)
    # rerun has the columns of a matrix one after the other.
    turned = single(found["/world/camera", "Transform3D:mat3x3"]).reshape(-1, 3, 3).swapaxes(1, 2)
    assert np.allclose(turned, ENU @ poses.R_nc[row], atol=1e-6)
    assert np.allclose(np.linalg.det(turned), 1.0, atol=1e-5)


def test_time_counts_from_the_first_pose_whatever_the_clock_shows(ship):
    def later(tables: dict[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
        return {
            name: table.assign(time_s=table["time_s"] + 1000.0) if "time_s" in table else table
            for name, table in tables.items()
        }

    moved = replace(ship, nav=later(ship.nav), tables=later(ship.tables))
    one, other = (scene_of(flight) for flight in (ship, moved))
    for part in ("path", "views", "points"):
        assert np.allclose(getattr(one, part).times, getattr(other, part).times)
    assert other.path is not None and other.path.times[0] == 0.0


def test_what_the_viewer_projects_lands_on_the_detection(ship, tmp_path):
    """Points on the ground, seen through the recording's own camera, are where the images have them."""
    found = saved(ship, tmp_path)
    camera = ship.manifest.geometry_camera()
    assert camera.distortion == pytest.approx((0.0,) * 5)
    K = np.array(found["/world/camera/image", "Pinhole:image_from_camera"].values[0][0]).reshape(3, 3).T
    places = found["/world/points/places", "Points3D:positions"]
    seen = found["/world/camera/image/detections", "Points2D:positions"]
    moved = found["/world/camera", "Transform3D:translation"]
    turned = single(found["/world/camera", "Transform3D:mat3x3"]).reshape(-1, 3, 3).swapaxes(1, 2)
    compared = 0
    for t, points in zip(places.times, places.values, strict=True):
        k = int(np.abs(moved.times - t).argmin())
        pixels = seen.values[int(np.abs(seen.times - t).argmin())]
        in_camera = (np.array(points) - np.array(moved.values[k][0])) @ turned[k]
        back = in_camera @ K.T
        assert np.allclose(back[:, :2] / back[:, 2:], pixels, atol=0.2)
        compared += len(points)
    assert compared > 50


def test_footprints_are_those_of_the_geometry(ship, tmp_path):
    found = saved(ship, tmp_path)["/world/footprint", "LineStrips3D:strips"]
    poses, level = poses_of(ship, "autopilot"), ground_height(ship)
    assert level is not None
    camera = poses.camera
    corners = np.array([[0, 0], [camera.width, 0], [camera.width, camera.height], [0, camera.height]]) - 0.5
    stamps = frame_times(ship) - ship.nav["autopilot"]["time_s"].iloc[0]
    drawn = 0
    for t, strips in zip(found.times, found.values, strict=True):
        if not strips:
            continue
        k = int(np.abs(stamps - t).argmin())
        expected = georeference_pixels(poses.take(np.full(4, k)), corners, np.full(4, level[0])) @ ENU.T
        ring = np.array(strips[0])
        assert np.allclose(ring[0], ring[-1])
        assert np.allclose(ring[[0, 4, 8, 12]], expected, atol=0.02)
        drawn += 1
    assert drawn > 0.9 * np.isfinite(poses.p_nc).all(axis=1).sum()


def test_no_ray_past_the_horizon_makes_a_footprint(ship):
    level = replace_in_manifest(ship.manifest, {"mount": {"looks": "forward", "tilt_deg": 0.0}})
    poses = poses_of(replace(ship, manifest=level), "autopilot")
    assert np.isnan(footprints(replace(ship, manifest=level), poses)).all()
    scene = scene_of(replace(ship, manifest=level))
    assert len(scene.lacks) > len(scene_of(ship).lacks)


def test_ellipses_hold_what_they_say():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(40, 2, 2))
    P = A @ A.swapaxes(1, 2) + 0.1 * np.eye(2)
    places = rng.normal(0, 50, (40, 3))
    rings = ellipse_rings(places, P)
    assert np.allclose(rings[..., 2], places[:, None, 2]) and np.allclose(rings[:, 0], rings[:, -1])
    offset = (rings - places[:, None])[..., :2]
    squared = np.einsum("nki,nij,nkj->nk", offset, np.linalg.inv(P), offset)
    assert np.allclose(squared, 4.605170185988092)
    for k in range(40):
        assert (
            inside_ellipse(0.999 * offset[k], P[k]).all()
            and not inside_ellipse(1.001 * offset[k], P[k]).any()
        )


def test_errors_and_nees_are_those_of_the_tables(ship, tmp_path):
    found = saved(ship, tmp_path)
    points = scene_of(ship).points
    assert points is not None
    error = found["/plots/error/detections", "Scalars:scalars"]
    known = np.isfinite(points.error)
    assert np.allclose(
        single(error).ravel() if np.ndim(error.values[0]) else error.values, points.error[known]
    )
    k = int(np.flatnonzero(known)[0])
    truth = ship.truth[ship.truth["target_id"] == points.names[k]]
    if truth["time_s"].notna().any():
        offset = ship.manifest.clocks.truth_offset_s - ship.nav["autopilot"]["time_s"].iloc[0]
        stamps = truth["time_s"].to_numpy() + offset
        at = [np.interp(points.times[k], stamps, truth[name]) for name in ("north_m", "east_m")]
    else:
        at = truth[["north_m", "east_m"]].to_numpy()[0]
    e = points.places[k, :2] - at
    assert points.error[k] == pytest.approx(np.hypot(*e), rel=1e-6)
    assert points.nees[k] == pytest.approx(e @ np.linalg.solve(points.covariance[k], e), rel=1e-6)


def test_terrain_becomes_triangles_that_lie_on_it():
    rng = np.random.default_rng(1)
    height = np.cumsum(rng.normal(size=(30, 50)), axis=1).astype(np.float32)
    height[3, 4] = np.nan
    vertices, triangles, colours, normals = mesh(height, -100.0, 20.0, 5.0)
    assert len(triangles) == 2 * 29 * 49 - 6
    ground = Terrain(height, -100.0, 20.0, 5.0)
    used = np.unique(triangles)
    there = ground.heights_at(vertices[used][:, [1, 0]])
    known = np.isfinite(there)  # beside an unknown node no height is known
    assert known.mean() > 0.99 and np.allclose(there[known], vertices[used, 2][known], atol=1e-4)
    sides = vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
    up = np.cross(sides[:, 0], sides[:, 1])
    assert (up[:, 2] > 0).all() and np.isfinite(normals).all() and len(colours) == len(vertices)
    # Of a plane that rises by 2 to the north and by a half to the east.
    north, east = 5.0 * np.mgrid[0:4, 0:6]
    *_, normals = mesh((2.0 * north + 0.5 * east).astype(np.float32), 0.0, 0.0, 5.0)
    assert np.allclose(normals / normals[:, 2:], [-0.5, -2.0, 1.0], atol=1e-5)


LACKING: dict[str, tuple[Callable[[Flight], Flight], str, str]] = {
    "images": (lambda f: without(f, "frames", "detections"), "images", "/world/flown/aircraft"),
    "camera": (
        lambda f: replace(f, manifest=f.manifest.model_copy(update={"camera": None})),
        "no camera",
        "/world/camera/image/detections",
    ),
    "poses of the camera": (
        lambda f: replace(f, nav={"autopilot": f.nav["autopilot"].head(5)}),
        "no pose",
        "/world/camera/image/detections",
    ),
}


def without(flight: Flight, *tables: str) -> Flight:
    return replace(flight, tables={n: t for n, t in flight.tables.items() if n not in tables})


@pytest.mark.parametrize("what", LACKING)
def test_what_lacks_is_said_and_the_rest_is_shown(ship, tmp_path, what):
    spoil, said, still = LACKING[what]
    flight = spoil(ship)
    scene = scene_of(flight)
    assert any(said in one for one in scene.lacks), scene.lacks
    assert not any(said in one for one in scene_of(ship).lacks)
    assert any(entity == still for entity, _ in saved(flight, tmp_path))


def test_nothing_tells_where_when_or_by_whom(ship, tmp_path):
    manifest = replace_in_manifest(
        ship.manifest,
        {"origin": {"latitude_deg": 12.345678, "longitude_deg": 98.765432, "height_m": 432.125}},
    )
    saved(replace(ship, manifest=manifest), tmp_path)
    data = (tmp_path / "replay.rrd").read_bytes()
    needles = [b"12.345", b"98.765", b"432.125", str(tmp_path).encode(), b"latitude", b"longitude"]
    needles += [np.float64(x).tobytes() for x in (12.345678, 98.765432, 432.125, np.radians(12.345678))]
    assert ship.manifest.time.epoch is not None
    needles += [str(ship.manifest.time.epoch.year).encode() + b"-"]
    assert [one for one in needles if one in data] == []


HOSTILE = [
    "](http://x.example/a.png)![",
    "a/b\\c d",
    "<script>alert(1)</script>",
    "",
    "\u202egpj.exe\n# big",
    "x" * 5000,
]


def test_names_of_strangers_stay_names(ship, tmp_path):
    names = pd.Series(HOSTILE)
    seen = ship.table("detections")
    seen = seen.assign(target_id=names.iloc[np.arange(len(seen)) % len(names)].to_numpy())
    truth = pd.DataFrame(
        {"target_id": HOSTILE, "time_s": np.nan, "north_m": 1.0, "east_m": 2.0, "down_m": 0.0}
    )
    moving = truth.assign(target_id=[f"{name} m" for name in HOSTILE], time_s=0.5)
    later = moving.assign(time_s=3.5)
    tables = ship.tables | {"detections": seen, "truth": pd.concat([truth, moving, later])}
    manifest = ship.manifest.model_copy(update={"name": HOSTILE[0]})
    found = saved(replace(ship, tables=tables, manifest=manifest), tmp_path)
    text = found["/about", "TextDocument:text"].values[0][0]
    assert "](http" not in text and "![" not in text.replace("\\!\\[", "")
    labels = {
        one
        for some in found["/world/camera/image/detections", "Points2D:labels"].values
        for one in some or ()
    }
    assert max(map(len, labels)) <= 60 and not any("\u202e" in one or "\n" in one for one in labels)
    assert sum(entity.startswith("/world/truth/") and entity.endswith("/now") for entity, _ in found) >= len(
        HOSTILE
    )


def test_pictures_stand_at_their_frames_and_detections_in_their_pixels(ship, tmp_path):
    camera = ship.manifest.geometry_camera()
    size = round(camera.width / 2), round(camera.height / 2)
    jpeg = cv2.imencode(".jpg", np.full((size[1], size[0]), 90, np.uint8))[1].tobytes()
    shots = {0: Shot(jpeg, 0.5), 7: Shot(jpeg, 0.5)}
    found = saved(ship, tmp_path, shots=shots)
    blobs = found["/world/camera/image", "EncodedImage:blob"]
    views = scene_of(ship).views
    assert views is not None and blobs.times is not None
    assert np.allclose(blobs.times, views.times[[0, 7]], atol=1e-6)
    assert bytes(blobs.values[0][0]) == jpeg
    whole = saved(ship, tmp_path)["/world/camera/image/detections", "Points2D:positions"].values
    half = found["/world/camera/image/detections", "Points2D:positions"].values
    for a, b in zip(whole, half, strict=True):
        assert np.allclose(np.array(a).reshape(-1, 2) / 2, np.array(b).reshape(-1, 2), atol=1e-3)
    K = np.array(found["/world/camera/image", "Pinhole:image_from_camera"].values[0][0]).reshape(3, 3).T
    p = np.array([[1.0, -2.0, 30.0]])
    uv = (p @ K.T)[0]
    assert np.allclose((uv[:2] / uv[2]) / 0.5 - 0.5, project(camera, p)[0], atol=1e-3)


def test_nothing_half_written_is_left(ship, tmp_path, monkeypatch):
    (tmp_path / "replay.rrd").write_bytes(b"before")

    def broken(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("wildlab.replay.recording._Writer.truth", broken)
    with pytest.raises(KeyboardInterrupt):
        saved(ship, tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["replay.rrd"]
    assert (tmp_path / "replay.rrd").read_bytes() == b"before"
