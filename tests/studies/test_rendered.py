"""Detections out of rendered images: which exposure is which frame, what is moved, what takes whose place."""

import numpy as np
import pytest

from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.vessel_detection import Photographer, exposures_of, marks_of, with_detections

TWIN, SEED = "large-ship", 2


@pytest.fixture(scope="module")
def flight():
    return simulate_twin(TWIN, SEED)


@pytest.fixture(scope="module")
def camera():
    return Photographer(TWIN, SEED)


@pytest.fixture(scope="module")
def shots(flight, camera):
    return list(camera.shoot(exposures_of(flight.frames)[20:120:33]))


def shape_of(camera):
    return camera.flight.poses.camera.height, camera.flight.poses.camera.width


def test_the_stated_centre_is_the_target_seen_through_the_true_pose(camera, shots):
    for shot in shots:
        pose = camera.flight.poses.take(shot.exposure)
        body = camera.flight.bodies(shot.exposure)[0]
        uv = ground_to_pixel(pose.camera, body.centre[None], pose.p_nc, pose.R_nc)[0]
        assert np.allclose(uv, shot.seen[0].uv)


def test_centres_of_what_the_border_cuts_are_moved_where_the_length_is_known(camera, shots):
    plain = marks_of(shots, shape_of(camera))
    assert not plain.moved.any()
    for uv, shot in zip(plain.uv, shots, strict=True):
        assert np.array_equal(uv, shot.detections.uv[shot.judged.found[1][0]])
    moved = marks_of(shots, shape_of(camera), length=535.0)
    assert moved.moved.any()
    assert (moved.uv[~moved.moved] == plain.uv[~moved.moved]).all()
    assert (plain.share[moved.moved] < 1).all()
    assert (np.hypot(*(moved.uv - plain.uv)[moved.moved].T) > 0).all()


def test_rendered_detections_take_the_place_of_the_drawn_ones(flight, camera, shots):
    marks = marks_of(shots, shape_of(camera))
    made = with_detections(flight, marks, "ship")
    assert made.frames["frame_id"].tolist() == [f"f{shot.exposure + 1:06d}" for shot in shots]
    assert np.array_equal(made.detections[["u_px", "v_px"]].to_numpy(), marks.uv)
    assert set(made.detections["target_id"]) == {"ship"}
    assert len(flight.detections) == 438, "the flight itself stays as it is"
    assert made.nav is flight.nav
    whole = with_detections(flight, marks, "ship", all_frames=True)
    assert len(whole.frames) == len(flight.frames)


def test_a_window_is_that_part_of_the_whole_image():
    camera = Photographer("fast-vessel", 1)
    flown = simulate_twin("fast-vessel", 1, ("imu", "gnss"))
    exposures = exposures_of(flown.detections)[::60]
    for exposure in map(int, exposures):
        window = camera.flight.window(exposure, 20)
        part = camera.flight.view(exposure, window)
        whole = camera.flight.view(exposure)
        assert part.kelvin.size < 0.1 * whole.kelvin.size
        assert np.array_equal(part.kelvin, whole.kelvin[window.slices])
        assert np.array_equal(part.labels, whole.labels[window.slices])
    windows, wholes = list(camera.shoot(exposures, margin=48)), list(camera.shoot(exposures))
    for part, whole in zip(windows, wholes, strict=True):
        one, other = part.seen[0], whole.seen[0]
        for name in ("uv", "centre", "middle"):
            assert np.allclose(getattr(one, name), getattr(other, name)), name
        assert np.allclose(np.ptp(one.outline, axis=0), np.ptp(other.outline, axis=0))
        boxes = (shot.detections.box[shot.judged.found[1][0]] for shot in (part, whole))
        assert np.abs(np.subtract(*boxes)).max() <= 2, "but for other draws of the noise"
    apart, together = (marks_of(shots, shape_of(camera)) for shots in (windows, wholes))
    assert np.allclose(apart.centre, together.centre)
    # The noise has other draws; what they move is a fraction of a pixel.
    assert np.hypot(*(apart.uv - together.uv).T).max() < 0.5
