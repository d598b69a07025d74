"""A recording read back and held against the flight's own numbers."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.replay.recordings import read_recording
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.georeference import Terrain
from wildlab.replay.recording import CORNERS, ellipse_rings, save_recording
from wildlab.replay.scene import Sightings, scene_of
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def ship():
    return simulate_twin("large-ship", 1)


def saved(scene, folder, shots=None):
    save_recording(scene, folder / "replay.rrd", shots)
    assert [one.name for one in folder.iterdir()] == ["replay.rrd"]
    return read_recording(folder / "replay.rrd")


def single(found):
    """(N, K) where each time has one instance."""
    return np.array([one[0] for one in found.values], float)


def test_places_and_errors_are_those_of_the_scene(ship, tmp_path):
    scene = scene_of(ship)
    found = saved(scene, tmp_path)
    aircraft = found["/world/aircraft/now", "Points3D:positions"]
    n, e, d = scene.path.places.T
    np.testing.assert_allclose(single(aircraft), np.stack([e, n, -d], axis=1), atol=1e-3)
    np.testing.assert_allclose(aircraft.times, scene.path.times, atol=1e-6)
    places = found["/world/points/places", "Points3D:positions"]
    assert sum(map(len, places.values)) == len(scene.points.times)
    error = found["/plots/error/points", "Scalars:scalars"]
    known = np.isfinite(scene.points.error)
    np.testing.assert_allclose(single(error), scene.points.error[known], rtol=1e-6)
    assert [path for path, _ in found if path.startswith("/world/truth/")]


def test_rings_are_the_border_of_what_holds_nine_tenths():
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(5, 2, 2))
    covariance, places = roots @ roots.swapaxes(1, 2), rng.normal(size=(5, 3))
    rings = ellipse_rings(places, covariance)
    assert rings.shape == (5, CORNERS + 1, 3) and (rings[..., 2] == places[:, None, 2]).all()
    for ring, place, P in zip(rings, places, covariance, strict=True):
        off = (ring - place)[:, :2]
        assert inside_ellipse(0.999 * off, P).all() and not inside_ellipse(1.001 * off, P).any()


def test_detections_lie_where_they_were_seen_in_a_smaller_picture(ship, tmp_path):
    scene = scene_of(ship)
    half = np.zeros((scene.camera.height // 2, scene.camera.width // 2, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", half)[1].tobytes()
    uv = np.array([[100.0, 50.0], [40.0, 30.0]])
    names = np.array(["a/b", "\u202eevil"], object)
    found = saved(replace(scene, sightings=Sightings(np.array([3, 4]), uv, names)), tmp_path, {3: jpeg})
    seen = found["/image/seen", "Points2D:positions"]
    there = [one for one in seen.values if one]
    np.testing.assert_allclose(np.array(there, float)[:, 0], [(uv[0] + 0.5) / 2, uv[1] + 0.5])
    labels = [one for one in found["/image/seen", "Points2D:labels"].values if one]
    assert labels == [["a/b"], ["evil"]]
    assert bytes(found["/image", "EncodedImage:blob"].values[0][0]) == jpeg


def test_terrain_lies_where_it_is_and_what_is_unknown_is_left_out(ship, tmp_path):
    height = np.arange(12.0, dtype=np.float32).reshape(3, 4)
    height[0, 0] = np.nan
    scene = replace(scene_of(ship), terrain=Terrain(height, north=100.0, east=-30.0, step=5.0))
    found = saved(scene, tmp_path)
    vertices = np.array(found["/world/terrain", "Mesh3D:vertex_positions"].values[0], float)
    np.testing.assert_allclose(vertices[6], [-30.0 + 2 * 5, 100.0 + 5, 6.0])  # east, north, up
    triangles = np.array(found["/world/terrain", "Mesh3D:triangle_indices"].values[0])
    assert len(triangles) == 2 * 6 - 2 and 0 not in triangles


def test_what_lacks_is_left_out_and_nothing_half_written_stays(ship, tmp_path):
    bare = replace(
        scene_of(ship),
        path=None,
        views=None,
        camera=None,
        sightings=None,
        points=None,
        truth=(),
        terrain=None,
    )
    assert not [path for path, _ in saved(bare, tmp_path) if path.startswith("/world/")]
    (tmp_path / "replay.rrd").write_bytes(b"before")
    with pytest.raises(AttributeError):
        save_recording(replace(bare, tracks=(None,)), tmp_path / "replay.rrd")
    assert [one.read_bytes() for one in tmp_path.iterdir()] == [b"before"]
