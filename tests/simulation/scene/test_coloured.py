"""Colour scenes: where a tarpaulin is drawn is what the projection says, and its labels are exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.scene.coloured import ColourView, Ground, Tarpaulin, render_colour

CAMERA = Camera(320, 180, 260.0, 260.0, 159.5, 89.5)
EVEN = Ground(patch_sd=0.0, noise_sd=0.0)
CLOTH = Tarpaulin(9.0, 5.0, course=0.7, north=4.0, east=-6.0)


def seen(
    tarpaulin: Tarpaulin | None = CLOTH, ground: Ground = EVEN, roll: float = 0.0, pitch: float = 0.0
) -> ColourView:
    R = euler_to_matrix(roll, pitch, 0.4) @ R_MC_DOWN
    return render_colour(ground, tarpaulin, CAMERA, [1.0, 2.0, -60.0], R, np.random.default_rng(1))


def test_it_is_drawn_where_its_corners_are_projected():
    view = seen(roll=0.15, pitch=-0.1)
    R = euler_to_matrix(0.15, -0.1, 0.4) @ R_MC_DOWN
    assert np.allclose(view.outline, ground_to_pixel(CAMERA, CLOTH.corners(), np.array([1.0, 2.0, -60.0]), R))
    a, b = view.outline, np.roll(view.outline, -1, axis=0)
    area = abs((a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]).sum()) / 2
    # What a pixel shows of it is its share of blue: in sum the area, and its middle the centroid.
    blue = view.image[..., 2].astype(float) - EVEN.colour[2]
    weight = blue / (CLOTH.colour[2] - EVEN.colour[2])
    assert weight.sum() == pytest.approx(area, rel=0.003)
    assert view.labels.sum() == pytest.approx(area, rel=0.02)
    v, u = np.mgrid[:180, :320]
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    centroid = ((a + b) * cross[:, None]).sum(axis=0) / (3 * cross.sum())
    assert np.allclose([(u * weight).sum(), (v * weight).sum()] / weight.sum(), centroid, atol=0.03)
    assert view.share == 1.0 and not view.sky.any()
    middle = np.array([[CLOTH.north, CLOTH.east, 0.0]])
    assert np.allclose(view.centre, ground_to_pixel(CAMERA, middle, np.array([1.0, 2.0, -60.0]), R)[0])


def test_the_border_cuts_it_and_behind_the_camera_it_is_nowhere():
    half = seen(replace(CLOTH, north=1.0, east=2.0, course=0.4), pitch=np.arctan(89.5 / 260.0))
    assert half.share == pytest.approx(0.5, abs=0.05) and half.labels.any()
    away = seen(replace(CLOTH, north=500.0))
    assert away.share == 0.0 and not away.labels.any() and np.isfinite(away.centre).all()
    nothing = seen(None)
    assert np.isnan(nothing.centre).all() and not nothing.labels.any()
    assert (nothing.image == np.rint(EVEN.colour)).all()


def test_the_rim_fades_to_the_ground_and_light_dims_everything():
    full, faded = (
        seen(replace(CLOTH, rim=rim, faded=1.0, course=0.4, north=1.0, east=2.0)) for rim in (0, 2)
    )
    assert (full.labels == faded.labels).all()
    row = faded.image[90, faded.labels[90], 2].astype(int)
    assert (np.diff(row[: len(row) // 2]) >= 0).all() and row[len(row) // 2] == CLOTH.colour[2] > row[0] + 50
    dim = seen(ground=replace(EVEN, light=0.5))
    assert np.allclose(dim.image, seen().image / 2, atol=0.51)


def test_the_sky_begins_at_the_horizon_and_grows_deeper():
    view = seen(pitch=np.pi / 2 - 0.05)
    rows = np.flatnonzero(view.sky.all(axis=1))
    assert rows.min() == 0 and rows.max() + 1 == pytest.approx(90 - 260 * np.tan(0.05), abs=0.5)
    red = view.image[rows, 160, 0].astype(int)
    assert (np.diff(red) >= 0).all() and red[-1] == pytest.approx(EVEN.horizon[0], abs=2)
    assert red[0] == EVEN.sky[0]


def test_patches_stay_on_the_ground_and_noise_follows_its_generator():
    rough = Ground(patch_sd=15.0, patch_length=4.0, noise_sd=0.0)
    here = render_colour(rough, None, CAMERA, [0, 0, -60.0], R_MC_DOWN, np.random.default_rng(1)).image
    there = render_colour(rough, None, CAMERA, [3.0, 0, -60.0], R_MC_DOWN, np.random.default_rng(1)).image
    assert np.abs(here[:-13].astype(int) - there[13:]).mean() < 1 < np.abs(here.astype(int) - there).mean()
    assert here.reshape(-1, 3).std(axis=0) == pytest.approx([15 * np.sqrt(1.25)] * 3, rel=0.2)
    noisy = replace(EVEN, noise_sd=6.0)
    assert (seen(ground=noisy).image == seen(ground=noisy).image).all()
    assert seen(None, noisy).image.std(axis=(0, 1)) == pytest.approx([6.0] * 3, rel=0.05)
