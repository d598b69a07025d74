"""Frames of a closed shutter or a held picture, dead pixels and dark corners: found, and not invented."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from wildlab.flight.readers.frames import Frame, mark_shutter, open_frames
from wildlab.flight.readers.frames.scene import (
    MOST_DEAD,
    find_dead,
    is_shutter,
    measure_vignetting,
    without_vignetting,
)
from wildlab.simulation.scene.flights import CameraResponse, Sensor, expose, sensor_of

SHAPE = (128, 160)
WHOLE = np.ones(SHAPE, bool)


def ground(seed: int, rough: float = 2.0) -> np.ndarray:
    """Uneven ground (K), another one for each seed."""
    rng = np.random.default_rng(seed)
    smooth = cv2.GaussianBlur(rng.normal(0, 1, SHAPE), (0, 0), 5)
    return np.asarray(285 + rough * smooth / smooth.std())


def shutter_image(level: float, response: CameraResponse, rng: np.random.Generator) -> np.ndarray:
    """What a camera shows with its shutter closed: the shutter's temperature (K), and noise."""
    even = np.full(SHAPE, level, np.float32)
    nothing = Sensor(np.zeros(SHAPE, np.float32), np.zeros(SHAPE, bool), np.zeros(SHAPE, np.uint16))
    return np.asarray(expose(even, response, nothing, rng))


def gain_control(counts: np.ndarray) -> np.ndarray:
    """256 grey levels of counts, a hundredth of the pixels black and one white: simple AGC."""
    low, high = np.quantile(counts, [0.01, 0.99])
    return np.clip(np.rint((counts - low) * (255 / max(high - low, 1.0))), 0, 255).astype(np.uint8)


def flight(path: Path, times: np.ndarray, response: CameraResponse) -> tuple[np.ndarray, np.ndarray]:
    """A folder of 16-bit frames with corrections; which are closed, and which pixels are dead."""
    rng = np.random.default_rng(3)
    sensor = sensor_of(response, SHAPE, rng)
    closed = (times >= 0.4) & (np.mod(times - 0.4, 1.0) < 0.25)
    path.mkdir()
    for number, (time, shut) in enumerate(zip(times, closed, strict=True)):
        image = expose(ground(number), response, sensor, rng)
        if shut:
            image = shutter_image(290 + time, response, rng)
            image[sensor.dead] = sensor.stuck[sensor.dead]
        assert cv2.imwrite(str(path / f"{number:03d}.png"), image)
    return closed, sensor.dead


def test_a_closed_shutter_is_found_and_nothing_else_and_dead_pixels_are_masked(tmp_path):
    response = CameraResponse(dead_share=1e-3)
    closed, dead = flight(tmp_path / "in", np.arange(24) / 9, response)
    frames = list(open_frames(tmp_path / "in"))
    assert [not one.usable for one in frames] == closed.tolist() and 4 <= closed.sum() <= 8
    masked = [~one.valid for one in frames if one.usable]
    assert all(np.array_equal(one, masked[0]) for one in masked)
    assert dead.sum() > 10 and (masked[0] & ~dead).sum() == 0
    # Two that touch are not told from a point of the scene, unless they never change.
    assert (masked[0] & dead).sum() >= 0.95 * dead.sum()
    # What stands in their place is no spike.
    open_ones = [one for one in frames if one.usable]
    assert max(float(one.image[masked[0]].max()) for one in open_ones) < 12000


@pytest.mark.parametrize("seed", range(3))
def test_closed_whatever_becomes_of_the_picture(seed):
    rng, response = np.random.default_rng(seed), CameraResponse()
    counts = shutter_image(280.0 + seed, response, rng)
    grey = gain_control(counts)
    jpeg = cv2.imdecode(cv2.imencode(".jpg", grey)[1], cv2.IMREAD_UNCHANGED)
    kelvin = counts.astype(np.float32) / 25
    assert [is_shutter(one, WHOLE) for one in (counts, grey, jpeg, kelvin)] == [True] * 4


def test_even_scenes_are_no_shutter():
    rng = np.random.default_rng(1)
    noise = rng.normal(7000, 1.25, SHAPE)
    dark = noise - 5 * ((np.mgrid[-1:1:128j, -1:1:160j] ** 2).sum(axis=0))
    warm, hull = noise.copy(), noise.copy()
    warm[60:63, 80:83] += 60
    hull[64:96, 32:64] += 1.0
    assert is_shutter(noise, WHOLE)
    assert not any(is_shutter(one, WHOLE) for one in (dark, warm, hull))
    assert not is_shutter(noise[:40, :40], WHOLE[:40, :40])  # too few blocks to judge by
    bordered = noise.copy()
    bordered[:40] = 0
    assert not is_shutter(bordered, WHOLE)
    assert is_shutter(bordered, WHOLE & (np.arange(128)[:, None] >= 40))


def frames_of(numbers: list[int]) -> list[Frame]:
    images = {number: (7000 + 25 * (ground(number) - 285)).astype(np.uint16) for number in set(numbers)}
    return [
        Frame(f"{place}", None, images[number], "counts", "white-hot", WHOLE)
        for place, number in enumerate(numbers)
    ]


def test_a_held_picture_is_told_from_the_third_frame_on_where_frames_differ_as_a_rule():
    numbers = [1, 2, 2, 3, 3, 3, 3, 4]
    marked = [one.usable for one in mark_shutter(frames_of(numbers), held_can_be_told=True)]
    assert marked == [True, True, True, True, True, False, False, True]
    assert all(one.usable for one in mark_shutter(frames_of(numbers), held_can_be_told=False))


def held_folder(path: Path, numbers: list[int]) -> Path:
    path.mkdir()
    for place, one in enumerate(frames_of(numbers)):
        assert cv2.imwrite(str(path / f"{place:03d}.png"), one.image)
    return path


def test_a_run_that_goes_on_marks_the_same_frames(tmp_path):
    numbers = [*range(10), 10, 10, 10, 10, *range(11, 30)]
    frames = open_frames(held_folder(tmp_path / "in", numbers))
    whole = [one.problem for one in frames]
    assert [number for number, problem in enumerate(whole) if problem] == [12, 13]
    for first in (0, 1, 11, 12, 13, 14):
        assert [one.problem for one in frames.starting_at(first)] == whole[first:]
    assert [one.problem for one in frames.some([10, 13, 20])] == [whole[10], whole[13], whole[20]]


def test_where_neighbours_are_alike_as_a_rule_nothing_is_held(tmp_path):
    frames = open_frames(held_folder(tmp_path / "in", [n // 4 for n in range(32)]))
    assert not frames.kept.held_can_be_told and all(one.usable for one in frames)


def scenes(count: int = 8, rough: float = 2.0) -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    return [7000 + 25 * (ground(n, rough) - 285) + rng.normal(0, 1.25, SHAPE) for n in range(count)]


def test_stuck_and_far_pixels_are_found_and_warm_points_are_not():
    images = scenes()
    rng = np.random.default_rng(2)
    for number, image in enumerate(images):
        image[10, 20] = 7000  # stuck amid the others
        image[30, 40] += 900 + rng.normal(0, 50)  # far, and noisy
        image[50, 60] -= 900
        image[70:72, 20 + 9 * number] += 900  # a body that moves
        blurred = np.zeros(SHAPE)
        blurred[100, 100] = 900
        image += cv2.GaussianBlur(blurred, (0, 0), 0.8)  # a point that stays, seen through a lens
        image[80:84, 120:126] = 7900 + rng.normal(0, 1.25, (4, 6))  # a sharp body that stays, with corners
    dead = find_dead(images, WHOLE)
    assert dead is not None
    assert np.argwhere(dead).tolist() == [[10, 20], [30, 40], [50, 60]]


def test_what_stands_still_or_is_too_few_tells_nothing():
    images = scenes()
    images[0][10, 10] = 9000
    assert find_dead([images[0]] * 8, WHOLE) is None
    assert find_dead(images[:4], WHOLE) is None
    assert find_dead(images, np.zeros(SHAPE, bool)) is None
    assert measure_vignetting([images[0] + k for k in range(8)], WHOLE) is None
    assert measure_vignetting(images[:4], WHOLE) is None


@pytest.mark.parametrize("fall", [-60.0, 40.0])
def test_dark_corners_are_measured_and_taken_off(fall):
    v, u = np.mgrid[:128, :160] - np.array([63.5, 79.5])[:, None, None]
    square = (u**2 + v**2) / (63.5**2 + 79.5**2)
    plain = scenes(12, rough=0.4)
    images = [one + fall * (0.7 * square + 0.3 * square**2) for one in plain]
    found = measure_vignetting(images, WHOLE)
    assert found is not None and found.images == 12
    assert abs(found.corner - fall) < 4 * found.sd and found.sd < 0.1 * abs(fall)
    left = np.mean(
        [without_vignetting(one, found.offset) - two for one, two in zip(images, plain, strict=True)], 0
    )
    assert np.abs(left).max() < 0.2 * abs(fall)
    assert measure_vignetting(plain, WHOLE) is None


def test_whole_numbers_stay_whole_and_within_their_kind():
    offset = np.array([[-10.4, 10.4]], np.float32)
    assert without_vignetting(np.array([[250, 5]], np.uint8), offset).tolist() == [[255, 0]]
    assert without_vignetting(np.array([[250, 50]], np.uint16), offset).tolist() == [[260, 40]]
    assert without_vignetting(np.array([[280.0, 5]], np.float32), offset).dtype == np.float32


def test_the_one_iterator_takes_the_corners_off_where_that_is_asked(tmp_path):
    flight(
        tmp_path / "in", np.array([0.0, 0.2, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2]), CameraResponse(vignetting=4.0)
    )
    as_seen, even = (open_frames(tmp_path / "in", even=flag) for flag in (False, True))
    assert as_seen.kept.vignetting is None and even.kept.vignetting is not None
    assert 75 < even.kept.vignetting.corner < 125  # 4 K are 100 counts

    def corners(frames: object) -> float:
        return float(
            np.mean([np.mean(one.image[:12, :12]) - np.mean(one.image[58:70, 74:86]) for one in frames])
        )

    assert corners(as_seen) > 50 and abs(corners(even)) < 0.5 * corners(as_seen)


@pytest.mark.slow
def test_real_frames_are_no_shutter_and_one_camera_has_one_dead_pixel(shared_data):
    for name in ("IR_BIRD_070", "IR_DRONE_001"):
        assert all(one.usable for one in open_frames(shared_data("imagery", "ir_tracks", f"{name}.mp4")))
    assert all(one.usable for one in open_frames(shared_data("imagery", "hit_uav", "images")))
    # Two flights of one camera, each judged by itself.
    for line in ("1", "3"):
        frames = open_frames(shared_data("imagery", "aos_f6", "images", line), even=True)
        dead, vignetting = frames.kept.dead, frames.kept.vignetting
        assert dead is not None and np.argwhere(dead).tolist() == [[368, 89]]
        assert vignetting is not None and -60 < vignetting.corner < -20


def test_few_grey_levels_repeat_without_a_fault():
    rng = np.random.default_rng(4)
    seen = [rng.normal(100, 0.8, (120, 160)).round().astype(np.uint8) for _ in range(7)]
    still = np.all([one == seen[0] for one in seen], axis=0)
    assert 20 < still.sum() < MOST_DEAD * still.size
    dead = find_dead(seen, np.ones((120, 160), bool))
    assert dead is not None and not dead.any()
