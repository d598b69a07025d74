"""A camera: its lens out of images of a board, and what to add to the stamps of its images, from points that
were seen or from their motion.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis import Fact, fact
from wildlab.analysis.diagnose import diagnose
from wildlab.analysis.georeference import camera_poses_at, georeference, observe, score_points
from wildlab.detection.boards import Board, find_board, grey8
from wildlab.detection.flow import as_grey, image_motion
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import BoardPart, CameraFile, EvidencePart, ParameterPart, ViewPart
from wildlab.flight.checks.known_points import ENOUGH, NEAR_CLOCKS, sighting_cost, sightings
from wildlab.flight.clocks import frame_times
from wildlab.flight.manifest import CameraPart
from wildlab.flight.readers.frames import Frame
from wildlab.flight.readers.frames.image import file_name, read_image
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_clock import FEWEST as FEWEST_PAIRS
from wildlab.geometry.camera_clock import clock_by_motion, translation_over_ground
from wildlab.geometry.camera_poses import camera_rotation
from wildlab.geometry.frames import Array, Indices, Mask, matrix_to_rotation_vector
from wildlab.geometry.intrinsics import (
    FEWEST,
    PINHOLE,
    Intrinsics,
    LensChoice,
    calibrate_camera,
    choose_lens,
    parameters_of,
    view_errors,
)
from wildlab.names import listed

#: A view disagrees where its held-out error is this many times the median, and this many robust standard
#: deviations above it.
TIMES, DEVIATIONS = 3.0, 4.0
#: No more than this share of the views may be called odd: the rest would not know either.
ODD = 0.25
#: Columns and rows of the raster that coverage is counted in.
RASTER = (8, 6)


@dataclass(frozen=True)
class BoardImage:
    """One image, and what became of it.

    Attributes
    ----------
    name
        Of the file.
    problem
        Why it is not used; empty where it is.
    uv
        (M, 2) pixels of the board's points; None where there is none.
    inverted
        Whether the board was found only once the image was inverted.
    """

    name: str
    problem: str
    uv: Array | None = None
    inverted: bool = False


@dataclass(frozen=True)
class CameraCalibration:
    """A camera and what it rests on.

    Attributes
    ----------
    board, width, height
        What was photographed, and the size of the images.
    images
        All that were given, in their order.
    choice
        Which lens model, and how the others did on views held out.
    found
        The estimate.
    held_out
        (V,) error of each view under the estimate without it, pixels.
    odd
        Names of views that disagree with the rest.
    without_odd
        The estimate without these; None where there are none.
    """

    board: Board
    width: int
    height: int
    images: tuple[BoardImage, ...]
    choice: LensChoice
    found: Intrinsics
    held_out: Array
    odd: tuple[str, ...]
    without_odd: Intrinsics | None

    @property
    def views(self) -> tuple[BoardImage, ...]:
        """The images with a board that is used, in the order of the estimate's views."""
        return tuple(one for one in self.images if one.uv is not None and not one.problem)

    @property
    def uv(self) -> Array:
        """(V, M, 2) pixels of the boards."""
        return np.array([one.uv for one in self.views])


def calibrate_images(
    paths: Sequence[Path],
    board: Board,
    lens: str = "auto",
    leave_out: Sequence[str] = (),
    progress: Callable[[Iterable[Path]], Iterable[Path]] = iter,
) -> CameraCalibration:
    """A camera from image files of a board.

    Parameters
    ----------
    paths
        Of the images. One that cannot be read, or shows no board, is said and left out.
    board
        What to look for.
    lens
        One of `wildlab.geometry.intrinsics.LENSES`, or "auto": chosen on views held out.
    leave_out
        Names of images not to use.
    progress
        Wraps the paths, to show how far it is.

    Returns
    -------
    CameraCalibration

    Raises
    ------
    WildlabError
        Where the images have several sizes, too few show the board, or no camera fits.
    """
    unknown = sorted(set(leave_out) - {file_name(path) for path in paths})
    if unknown:
        raise WildlabError(
            f"{unknown[0]!r} is to be left out, and is not among the images",
            "give the name of a file, without its folder",
            field="--without",
        )
    images: list[BoardImage] = []
    sizes: dict[str, tuple[int, int]] = {}
    for path in progress([one for one in paths if file_name(one) not in leave_out]):
        frame = read_image(path)
        if frame.problem:
            images.append(BoardImage(frame.name, frame.problem))
            continue
        pixels = frame.image
        sizes[frame.name] = (pixels.shape[1], pixels.shape[0])
        images.append(_look(frame.name, pixels, board))
    width, height = _one_size(sizes)
    wanted = f"most of the images have {width} x {height}"
    images = [
        BoardImage(one.name, "It has {} x {} pixels, and {}.".format(*sizes[one.name], wanted))
        if sizes.get(one.name, (width, height)) != (width, height)
        else one
        for one in images
    ]
    used = [one for one in images if one.uv is not None]
    if len(used) < FEWEST:
        _refuse_few(images, len(used), board)
    return solve_boards(tuple(images), board, width, height, lens)


def solve_boards(
    images: tuple[BoardImage, ...],
    board: Board,
    width: int,
    height: int,
    lens: str = "auto",
) -> CameraCalibration:
    """The same from boards that are found already.

    Parameters
    ----------
    images
        With the pixels of their boards.
    board, lens
        As for `calibrate_images`.
    width, height
        Of the images, pixels.

    Returns
    -------
    CameraCalibration

    Raises
    ------
    WildlabError
        Where no camera fits.
    """
    used = [one for one in images if one.uv is not None and not one.problem]
    points, uv = board.points / board.spacing, np.array([one.uv for one in used])
    choice = choose_lens(points, uv, width, height) if lens == "auto" else LensChoice(lens, {})
    found = calibrate_camera(points, uv, width, height, choice.lens)
    held_out = held_out_errors(found, points, uv)
    odd, rest = np.zeros(len(uv), bool), None
    errors = held_out
    # One at a time, the worst first: a view that is wrong pulls the camera away from others too.
    while odd.sum() < _most_odd(len(uv)) and (wrong := odd_views(errors)).any():
        odd[np.flatnonzero(~odd)[np.where(wrong, errors, -np.inf).argmax()]] = True
        rest = calibrate_camera(points, uv[~odd], width, height, choice.lens)
        errors = held_out_errors(rest, points, uv[~odd])
    names = tuple(one.name for one, is_odd in zip(used, odd, strict=True) if is_odd)
    return CameraCalibration(board, width, height, images, choice, found, held_out, names, rest)


def held_out_errors(found: Intrinsics, points: Array, uv: Array) -> Array:
    """Error (V,) of each view under the camera that the others give, pixels.

    Parameters
    ----------
    found
        The estimate.
    points, uv
        It was made of, (M, 3) and (V, M, 2).

    Returns
    -------
    (V,) root mean squared distances, pixels.
    """
    cameras = [found.camera_with(values) for values in found.without]
    return np.array([view_errors(c, points, one[None])[0] for c, one in zip(cameras, uv, strict=True)])


def _most_odd(views: int) -> int:
    return min(int(ODD * views), views - FEWEST)


def odd_views(errors: Array) -> Mask:
    """Which views disagree with the rest, by their held-out errors.

    Parameters
    ----------
    errors
        (V,) pixels.

    Returns
    -------
    (V,) bool; at most a quarter of them, the worst.
    """
    middle = np.median(errors)
    spread = 1.4826 * np.median(np.abs(errors - middle))
    odd = (errors > TIMES * middle) & (errors > middle + DEVIATIONS * spread)
    most = _most_odd(len(errors))
    if odd.sum() > most:
        odd &= errors >= (np.sort(errors)[-most] if most > 0 else np.inf)
    return odd


def coverage(uv: Array, width: int, height: int) -> Mask:
    """Which cells of a raster of 8 x 6 over the image hold a point of a board: (6, 8) bool.

    Parameters
    ----------
    uv
        (..., 2) pixels.
    width, height
        Of the image.

    Returns
    -------
    (6, 8) bool, row by row.
    """
    columns, rows = RASTER
    u, v = uv.reshape(-1, 2).T
    held = np.zeros((rows, columns), bool)
    column = np.clip((u / width * columns).astype(int), 0, columns - 1)
    row = np.clip((v / height * rows).astype(int), 0, rows - 1)
    held[row, column] = True
    return held


def camera_file(found: CameraCalibration, name: str) -> CameraFile:
    """What is written to ``camera.toml``.

    Parameters
    ----------
    found
        The calibration.
    name
        Of the camera.

    Returns
    -------
    CameraFile
    """
    k = found.found
    theta = parameters_of(k.camera)
    parameters = []
    for one in k.names:
        low, high = k.interval(one)
        parameters.append(ParameterPart(name=one, value=k.value(one), sd=k.sd(one), low=low, high=high))
    return CameraFile(
        camera=CameraPart(
            name=name,
            width_px=found.width,
            height_px=found.height,
            **{f"{key}_px" if key in PINHOLE else key: value for key, value in theta.items()},
        ),
        board=BoardPart(
            pattern=found.board.pattern,
            columns=found.board.columns,
            rows=found.board.rows,
            spacing_m=found.board.spacing,
        ),
        evidence=EvidencePart(
            images=len(found.images),
            views=len(found.views),
            points=int(np.isfinite(found.uv).all(axis=-1).sum()),
            lens=found.choice.lens,
            rms_px=k.rms,
            covered=float(coverage(found.uv, found.width, found.height).mean()),
        ),
        covariance=tuple(tuple(row) for row in k.covariance.tolist()),
        parameter=tuple(parameters),
        view=tuple(
            ViewPart(name=one.name, rms_px=float(rms), inverted=one.inverted)
            for one, rms in zip(found.views, k.view_rms, strict=True)
        ),
    )


def _look(name: str, pixels: NDArray[Any], board: Board) -> BoardImage:
    grey = grey8(pixels)
    if not grey.any():
        return BoardImage(name, "nothing differs in it")
    seen = find_board(grey, board)
    if seen is None:
        return BoardImage(name, "the whole board is not to be seen in it")
    return BoardImage(name, "", seen.uv, seen.inverted)


def _one_size(sizes: dict[str, tuple[int, int]]) -> tuple[int, int]:
    """Width and height of most of the images; a camera has one size of image."""
    if not sizes:
        raise WildlabError("none of the images can be read", "name images of the board")
    counts = Counter(sizes.values())
    usual, most = counts.most_common(1)[0]
    if 2 * most <= len(sizes):
        name, (width, height) = next((n, size) for n, size in sizes.items() if size != usual)
        raise WildlabError(
            f"has {width} x {height} pixels, {most} of {len(sizes)} images have {usual[0]} x {usual[1]}, and "
            "no size has more than half of them",
            "calibrate the images of each size by themselves",
            file=name,
        )
    return usual


def _refuse_few(images: list[BoardImage], n: int, board: Board) -> None:
    kind = "inner corners" if board.pattern == "chessboard" else "circles"
    what = f"{board.columns} x {board.rows} {kind}"
    if n == 0:
        other = "; add --staggered where every other row is moved by half a step"
        raise WildlabError(
            f"a board of {what} is in none of the {len(images)} images",
            f"count the {kind}, columns times rows; the whole board must be in view, and in focus"
            + (other if board.pattern == "circles" else ""),
            field="--board" if board.pattern == "chessboard" else "--circles",
        )
    raise WildlabError(
        f"a board of {what} is in {n} of {len(images)} images, and at least {FEWEST} are needed",
        "take 20 or more, from all sides, tilted by up to 45 degrees, all over the image",
    )


#: A raster that boards cover less than this share of leaves the lens to guesswork.
COVERED = 0.8
#: Fewer views than this give wide intervals.
PLENTY = 15
#: Tilts less than this (degrees) hardly tell focal length from distance.
FLAT_DEG = 15.0


def _boards(found: CameraCalibration) -> Fact:
    """How many boards, and how many of them only once the image was inverted."""
    views, inverted = len(found.views), sum(one.inverted for one in found.views)
    key = "camera-boards" if not inverted else "camera-inverted" if inverted == views else "camera-mixed"
    return fact(key, views=views, images=len(found.images), inverted=inverted)


def _fit(found: CameraCalibration) -> Fact:
    """How well it fits, by which lens, and why that one."""
    rms, lens, tried = f"{found.found.rms:.3f}", found.choice.lens, found.choice.held_out
    model = "a lens that does not bend" if lens == "none" else f'the lens model "{lens}"'
    if not tried:
        return fact("camera-fit", rms=rms, model=model)
    best = min(tried, key=lambda name: tried[name])
    key = "camera-fit-best" if best == lens else "camera-fit-simpler"
    return fact(key, rms=rms, model=model, own=f"{tried[lens]:.3f}", best=best, other=f"{tried[best]:.3f}")


def _covered(found: CameraCalibration) -> Fact:
    """How much of the image the boards cover, and where they do not."""
    held = coverage(found.uv, found.width, found.height)
    rows, columns = held.shape
    sides = {"upper": slice(None, rows // 2), "lower": slice(rows // 2, None)}
    shares = {
        f"{name} {side}": held[part, half].mean()
        for name, part in sides.items()
        for side, half in (("left", slice(None, columns // 2)), ("right", slice(columns // 2, None)))
    }
    worst = min(shares, key=lambda name: shares[name])
    key = "camera-covered" if held.mean() >= COVERED else "camera-uncovered"
    return fact(key, share=f"{100 * held.mean():.0f}", worst=worst, least=f"{100 * shares[worst]:.0f}")


def _odd(found: CameraCalibration) -> list[Fact]:
    """Views that disagree with the rest, and what becomes of the estimate without them."""
    rest = found.without_odd
    if rest is None:
        return []
    errors = dict(zip((one.name for one in found.views), found.held_out, strict=True))
    usual = float(np.median([error for name, error in errors.items() if name not in found.odd]))
    which = listed([f"{name} ({errors[name]:.2f} px)" for name in found.odd])
    moved = ", ".join(
        f"{name} {found.found.value(name):.1f} -> {rest.value(name):.1f}"
        for name in found.found.names
        if name in PINHOLE
    )
    option = " ".join(f"--without {name}" for name in found.odd)
    return [
        fact(
            "camera-odd", which=which, usual=f"{usual:.2f}", rms=f"{rest.rms:.3f}", moved=moved, option=option
        )
    ]


def facts_of(found: CameraCalibration) -> list[Fact]:
    """All that is said of a calibration, in order; its words are in ``data/messages/en/terminal.toml``."""
    said = [_boards(found), _fit(found), _covered(found)]
    tilted = np.degrees(np.arccos(np.clip(np.abs(found.found.views.rotation[:, 2, 2]), 0, 1))).max()
    if tilted < FLAT_DEG:
        said.append(fact("camera-flat", tilt=f"{tilted:.0f}"))
    said += _odd(found)
    if len(found.views) < PLENTY:
        said.append(fact("camera-few", views=len(found.views), plenty=PLENTY))
    return said


#: Images further apart in time (s) are not compared: between them the camera may have turned to and fro.
LONGEST_PAIR_S = 1.0


def refuse_without_clock(flight: Flight, source: str | None = None) -> None:
    """Refuse a flight whose images have no clock of their own.

    Raises
    ------
    WildlabError
        Where its times merely number the images, or its poses belong to images by name.
    """
    if not flight.timed:
        raise WildlabError(
            "the images carry no time, so there is no clock to estimate",
            "import with times if the images have any",
            file=flight.folder,
            field="time.kind",
        )
    name, nav = flight.pose_source(source)
    if "frame_id" in nav:
        raise WildlabError(
            "these poses belong to images by name, whatever their clock says",
            "choose other poses with --source, if there are any",
            file=flight.folder,
            field=f"nav/{name}",
        )


#: Beyond this (s) the clock is looked for before other constants; one apart by more is another, and one apart
#: by less than the second the same.
APART_S, SAME_S = 1.5, 0.1
#: Logarithm of how much more likely the best offset has to be than one that is apart, for each block.
CERTAIN = 5.0


def clock_from_points(flight: Flight, source: str | None = None) -> CameraClock:
    """What to add to the stamps of the images so that known points appear where they were seen.

    The estimate is that of `diagnose`, beside whatever else is constantly wrong; its standard deviation holds
    the distance to the clocks of models that explain the errors as well.

    Parameters
    ----------
    flight
        With frames, poses, pixel detections that name targets, and truth of these.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Raises
    ------
    WildlabError
        Where the images have no clock, or too few sightings of known points have a pose.
    """
    refuse_without_clock(flight, source)
    name, _ = flight.pose_source(source)
    seen = sightings(flight, name)
    if seen is None or not seen.named:
        raise WildlabError(
            f"fewer than {ENOUGH} detections with a pose are of a target whose position is known",
            "name the targets of detections and add their truth, or give the images with --images; "
            "wildlab check says whether images and poses are of the same time",
            file=flight.folder,
            field="detections",
        )

    cost = np.array([sighting_cost(seen.shifted(float(by))) for by in NEAR_CLOCKS])
    best = float(NEAR_CLOCKS[np.argmin(cost)])
    begun = best if abs(best) > APART_S else 0.0
    observations = observe(flight, name, clock_shift=begun)
    scored = score_points(flight, georeference(observations, np.random.default_rng(0)))
    found = diagnose(observations, scored)
    model = found.most_likely_with("clock")
    if model is None:
        raise WildlabError(
            "known points appear where they do whatever the clock of the camera",
            "use images of a stretch in which the camera moves, or state the offset",
            file=flight.folder,
            field="frames",
        )
    k, offset = model.fit.names.index("clock"), begun + model.value("clock")
    apart = np.where(np.abs(NEAR_CLOCKS - offset) > APART_S, cost, np.inf)
    blocks, rival = len(np.unique(found.blocks)), float(NEAR_CLOCKS[np.argmin(apart)])
    margin = blocks * (apart.min() - sighting_cost(seen.shifted(offset)))
    alone = margin > CERTAIN and abs(offset) < NEAR_CLOCKS[-1] - APART_S
    clocks = (begun + one.value("clock") for one in (found.winner, *found.rivals))
    other = max(clocks, key=lambda clock: abs(clock - offset))
    if alone:
        alone, rival = abs(other - offset) <= SAME_S, other
    sd = float(np.hypot(np.sqrt(model.covariance[k, k]), other - offset))
    numbers = {"offset_s": offset, "sd_s": sd, "rival_s": rival}
    rests = {"points": len(scored), "images": int(scored["frame_id"].nunique()), "blocks": blocks}
    doubt = "misfit" if not found.fits else "" if alone else "open"
    return _told(flight, "points", numbers, doubt, rests)


def image_motions(frames: Iterable[Frame], flight: Flight, camera: Camera) -> tuple[Indices, Array]:
    """How the scene moved from each image of a flight to the next that follows it closely.

    Parameters
    ----------
    frames
        Images in any order of names that the flight's frames have: by file name, with or without its ending.
    flight
        With frames.
    camera
        Its lens.

    Returns
    -------
    (pairs, motion)
        (N, 2) rows of the table ``frames``, and (N, 3) as from `image_motion`.
    """
    names = flight.table("frames")["frame_id"].astype(str)
    rows = {name: number for number, name in enumerate(names)}
    for number, name in enumerate(names):
        rows.setdefault(Path(name).stem, number)
    stamps = flight.table("frames")["time_s"].to_numpy(float)
    pairs: list[tuple[int, int]] = []
    motion: list[Array] = []
    before: tuple[int, NDArray[np.uint8], Mask] | None = None
    for frame in frames:
        row = rows.get(frame.name, rows.get(Path(frame.name).stem))
        if row is None or not frame.usable:
            before = None
            continue
        grey = as_grey(frame.image, frame.valid)
        if before is not None and before[1].shape == grey.shape:
            apart = stamps[row] - stamps[before[0]]
            if 0 < apart <= LONGEST_PAIR_S:
                pairs.append((before[0], row))
                motion.append(image_motion(before[1], grey, camera, before[2]))
        before = row, grey, frame.valid
    return np.array(pairs, np.intp).reshape(-1, 2), np.array(motion, float).reshape(-1, 3)


def clock_from_motions(
    flight: Flight, pairs: Indices, motion: Array, source: str | None = None
) -> CameraClock:
    """What to add to the stamps of the images so that they moved as the log says that the camera turned.

    Parameters
    ----------
    flight
        With frames and poses; gyros are used where it has them and the camera is fixed to the airframe.
    pairs, motion
        From `image_motions`.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Raises
    ------
    WildlabError
        Where the images have no clock, or too few of them could be followed within the log.
    """
    refuse_without_clock(flight, source)
    times, turned, moved = _camera_motion(flight, source)
    spans = frame_times(flight)[pairs].reshape(-1, 2)
    found = clock_by_motion(spans, motion, times, turned, moved)
    if found is None:
        followed = int(np.isfinite(motion).all(axis=1).sum())
        raise WildlabError(
            f"{followed} of {len(pairs)} pairs of images that follow each other within {LONGEST_PAIR_S:g} s "
            f"could be followed, and {FEWEST_PAIRS} within the log are needed",
            "give more images of a stretch in which the camera turns, or state the offset",
            file=flight.folder,
            field="frames",
        )
    rests = {"pairs": found.pairs, "correlation": found.peak, "rival_correlation": found.rival_correlation}
    estimate = {name: getattr(found, name) for name in ("offset_s", "sd_s", "rival_s")}
    doubt = "" if found.certain else "open"
    return _told(flight, "motion", estimate, doubt, rests | {"gain": found.gain})


def clock_from_images(flight: Flight, frames: Iterable[Frame], source: str | None = None) -> CameraClock:
    """`clock_from_motions` of images.

    Raises
    ------
    WildlabError
        As that.
    """
    refuse_without_clock(flight, source)
    pairs, motion = image_motions(frames, flight, flight.manifest.geometry_camera())
    return clock_from_motions(flight, pairs, motion, source)


def _camera_motion(flight: Flight, source: str | None) -> tuple[Array, Array, Array]:
    """Times (T,), and integrals (T, 3) of the camera's angular velocity in c and of what its travel shows."""
    _, nav = flight.pose_source(source)
    t = nav["time_s"].to_numpy(float)
    poses = camera_poses_at(flight, t, source)
    good = np.isfinite(poses.p_nc).all(axis=1) & np.isfinite(poses.R_nc).all(axis=(1, 2))
    t, p, R = t[good], poses.p_nc[good], poses.R_nc[good]
    if len(t) < 2:
        raise WildlabError(
            "the poses are too few to tell how the camera turned", "import more of the log", field="nav"
        )
    steps = matrix_to_rotation_vector(np.einsum("nji,njk->nik", R[:-1], R[1:]))
    turned = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    moved = translation_over_ground(p, R)
    if flight.imu is None or flight.gimbal is not None or "pan_rad" in flight.table("frames"):
        return t, turned, moved
    imu = flight.imu
    rates = imu[["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]].to_numpy(float)
    at = imu["time_s"].to_numpy(float)
    known = np.isfinite(rates).all(axis=1) & (at >= t[0]) & (at <= t[-1])
    known &= np.diff(np.fmax.accumulate(at), prepend=-np.inf) > 0
    if known.sum() < len(t):
        return t, turned, moved
    at, rates = at[known], rates[known] @ camera_rotation(flight.manifest.geometry_mount())
    between = (rates[1:] + rates[:-1]) / 2 * np.diff(at)[:, None]
    by_gyro = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    return at, by_gyro, np.stack([np.interp(at, t, one) for one in moved.T], axis=1)


class CameraClock(NamedTuple):
    """What to add to the stamps of the images, as ``clocks.camera_offset_s`` has it: not on top of that.

    Attributes
    ----------
    numbers
        ``offset_s``, ``sd_s``, ``certain``, ``method``, the next best offset
        ``rival_s`` and what the estimate rests on.
    facts
        What is said of it; the words are in ``data/messages/en/terminal.toml``.
    """

    numbers: dict[str, object]
    facts: tuple[Fact, ...]


def _told(
    flight: Flight,
    way: str,
    estimate: dict[str, float],
    doubt: str,
    rests: Mapping[str, float],
) -> CameraClock:
    stated = flight.manifest.clocks.camera_offset_s
    offset_s, rival_s = (estimate[name] + stated for name in ("offset_s", "rival_s"))
    numbers: dict[str, object] = {
        "offset_s": offset_s,
        "sd_s": estimate["sd_s"],
        "certain": not doubt,
        "method": {"points": "known points", "motion": "image motion"}[way],
        "rival_s": rival_s,
        **rests,
    }
    shown = {name: f"{one:.2f}" if isinstance(one, float) else str(one) for name, one in rests.items()}
    shown |= {"offset_s": f"{offset_s:+.3f}", "rival_s": f"{rival_s:+.3f}", "sd_s": f"{estimate['sd_s']:.3f}"}
    said = fact(f"clock-{way}-{doubt or 'certain'}", **shown)
    return CameraClock(numbers, (said,))
