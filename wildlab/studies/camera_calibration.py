"""The intrinsic matrix from 30 images of a circle grid (H 2.3, 2.4), on simulated images of H's camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.detection.boards import Board, find_board, grey8
from wildlab.evaluation.intervals import Interval
from wildlab.evaluation.replication import propagate_rounding
from wildlab.geometry.calibration import Mounting, mounting_from_points
from wildlab.geometry.camera import Camera, camera_from_data_sheet
from wildlab.geometry.camera_poses import CameraPoses, Mount, camera_rotation, helgesen_misalignment
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.geometry.intrinsics import PINHOLE, Views, calibrate_camera, parameters_of, project_board
from wildlab.reporting.charts.drawing import Values, draw_dots, finish, rows_chart
from wildlab.reporting.figures import BLUE, GREEN, INK, VERMILLION, new_figure
from wildlab.reporting.published import error_name
from wildlab.simulation.boards import board_image, board_views
from wildlab.studies.sensitivity import TAU2, helgesen_mount

#: Its data sheet: lens (m), pitch of the pixels (m), H table A.1.
LENS, PITCH = 0.019, 17e-6
#: How many images H took.
IMAGES = 30
#: H prints neither how many circles the plate has nor their distance: chosen.
GRID = Board("circles", 7, 7, 0.03)
#: Chosen: blur of the lens (px), and noise of the sensor with the grid's contrast of 150, in grey levels.
BLUR, NOISE = 0.7, 3.0
#: Height of H 5.6.1, metres.
HEIGHT = 350.0


def theoretical() -> Camera:
    """The camera of H (2.2) by its data sheet, which H (2.4) prints."""
    return camera_from_data_sheet(640, 512, LENS, 640 * PITCH, 512 * PITCH)


def theoretical_focal_length() -> Interval:
    """Its focal length, pixels; bounds are of what 19 mm and 17 µm were rounded from."""
    low, high = propagate_rounding(lambda one: one[0] / one[1], [LENS, PITCH], [0.5e-3, 0.5e-6])
    return Interval(LENS / PITCH, float(low), float(high))


class Centres(NamedTuple):
    """How well circles are found: views with the whole grid found, of how many; root mean squared error of a
    centre along one axis (px); and the last image with its centres."""

    found: int
    images: int
    sd: float
    image: Array
    uv: Array


def measure_centres(rng: np.random.Generator, images: int) -> Centres:
    """Render the warm grid, find its circles, and compare with where they are.

    Parameters
    ----------
    rng
        For views and noise.
    images
        How many.

    Returns
    -------
    Centres
    """
    views = board_views(rng, TAU2, GRID.points, images)
    squares: list[Array] = []
    image, last, found = np.zeros((TAU2.height, TAU2.width)), np.zeros((0, 2)), 0
    for R, t in zip(*views, strict=True):
        clean = board_image(TAU2, R, t, GRID.points, GRID.spacing, circles=True, warm=50.0, cold=200.0)
        noisy = cv2.GaussianBlur(clean, (0, 0), BLUR) + rng.normal(0, NOISE, clean.shape)
        seen = find_board(grey8(noisy), GRID)
        if seen is None:
            continue
        true = project_board(TAU2, Views(R[None], t[None]), GRID.points)[0]
        # A square grid does not say which circle is the first: each is compared with the nearest.
        nearest = np.linalg.norm(seen.uv[:, None] - true, axis=2).argmin(axis=1)
        squares.append((seen.uv - true[nearest]) ** 2)
        image, last, found = noisy, seen.uv, found + 1
    sd = float(np.sqrt(np.mean(squares))) if squares else float("nan")
    return Centres(found, images, sd, image, last)


def calibrations(rng: np.random.Generator, runs: int, sd: float, images: int = IMAGES) -> pd.DataFrame:
    """Calibrations of H's camera, each from a first and a second set of images.

    Parameters
    ----------
    rng
        For views and noise.
    runs
        How many.
    sd
        Of a centre along each axis, px.
    images
        In each set.

    Returns
    -------
    DataFrame
        A row a run: ``fx``, ``fy``, ``cx``, ``cy`` of the first set, and with ``sd_`` (as the calibration
        states it), ``inside_`` (the truth in its 95 % interval) and ``second_`` (of the second set).
    """
    truth = parameters_of(TAU2)
    rows = []
    for _ in range(runs):
        row: dict[str, float] = {}
        for prefix in ("", "second_"):
            views = board_views(rng, TAU2, GRID.points, images)
            uv = project_board(TAU2, views, GRID.points)
            uv = uv + rng.normal(0, sd, uv.shape)
            first = prefix == ""
            found = calibrate_camera(GRID.points, uv, TAU2.width, TAU2.height, "none", resample=first)
            for name in PINHOLE:
                row[prefix + name] = found.value(name)
                if first:
                    low, high = found.interval(name)
                    row[f"sd_{name}"] = found.sd(name)
                    row[f"inside_{name}"] = float(low <= truth[name] <= high)
        rows.append(row)
    return pd.DataFrame(rows)


#: As printed: the mean error left, at which range, and what that makes from the height of the flight, metres.
PRINTED_ERROR, PRINTED_RANGE, PRINTED_AT_HEIGHT = 0.0229, 1.2, 6.6
#: Chosen: images, known points in each (a square of this half side, m), attitudes within so many degrees.
POSES, HALF_SIDE, TILTED_DEG = 12, 0.2, 8.0
#: What may be wrong, with the unit it is counted in, and a size to begin with.
CAUSES = {
    "clicks": ("px", 2.0),
    "attitude": ("deg", 0.2),
    "position": ("m", 0.004),
    "lens offset": ("m", 0.01),
    "focal length": ("%", 1.0),
}
#: These are the same in all images, so that more images do not help.
CONSTANT = ("lens offset", "focal length")


class Cause(NamedTuple):
    """One cause alone.

    Attributes
    ----------
    name, unit
        What is wrong, and what its size is counted in.
    size
        That leaves the printed error: a standard deviation, or (of what is constant) the size itself.
    left, left_error
        Mean error left by it in the calibration, and its standard error, with that of the size found, metres.
    angle
        Root mean squared angle by which the lens then points elsewhere, radians.
    ground
        What that makes on the ground from the height of the flight, metres.
    """

    name: str
    unit: str
    size: float
    left: float
    left_error: float
    angle: float
    ground: float


def calibrate_once(rng: np.random.Generator, cause: str, size: float) -> tuple[Mounting, float]:
    """One calibration in the room, with one thing wrong.

    Parameters
    ----------
    rng
        For poses and errors.
    cause
        One of `CAUSES`.
    size
        In its unit.

    Returns
    -------
    tuple
        What was found, and by which angle the lens then points elsewhere (a turn about its own axis does not
        count), radians.
    """
    side = np.linspace(-HALF_SIDE, HALF_SIDE, 3)
    board = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    m = len(board)
    image = np.repeat(np.arange(POSES), m)
    euler = np.radians(rng.uniform(-TILTED_DEG, TILTED_DEG, (POSES, 3))) + [0, 0, 1] * rng.uniform(
        -np.pi, np.pi, (POSES, 1)
    )
    R = euler_to_matrix(*euler.T)
    p = np.column_stack([rng.uniform(-0.1, 0.1, (POSES, 2)), -rng.uniform(0.95, 1.05, POSES) * PRINTED_RANGE])
    points = np.column_stack([np.tile(board, (POSES, 1)), np.zeros(POSES * m)])

    mount = helgesen_mount()
    true = CameraPoses(TAU2, mount, p[image], R[image])
    uv = ground_to_pixel(TAU2, points, true.p_nc, true.R_nc)
    given_p, given_R, camera, given = p, R, TAU2, Mount("down")
    if cause == "clicks":
        uv = uv + rng.normal(0, size, uv.shape)
    elif cause == "attitude":
        given_R = R @ euler_to_matrix(*np.radians(rng.normal(0, size, (3, POSES))))
    elif cause == "position":
        given_p = p + rng.normal(0, size, p.shape)
    elif cause == "lens offset":
        arm = _direction(rng) * size
        given = Mount("down", lever_arm=(float(arm[0]), float(arm[1]), float(arm[2])))
    else:
        share = 1 + rng.choice([-1, 1]) * size / 100
        camera = type(TAU2)(640, 512, TAU2.fx * share, TAU2.fy * share, TAU2.cx, TAU2.cy)
    found = mounting_from_points(
        CameraPoses(camera, given, given_p[image], given_R[image]), uv, points, image
    )
    axes = camera_rotation(found.mount)[:, 2], camera_rotation(mount)[:, 2]
    return found, float(np.linalg.norm(np.cross(*axes)))


def _direction(rng: np.random.Generator) -> Array:
    one = rng.normal(size=3)
    return np.asarray(one / np.linalg.norm(one))


def try_cause(rng: np.random.Generator, cause: str, size: float, runs: int) -> Cause:
    """What one cause of that size leaves in so many calibrations, and what it then does."""
    found = [calibrate_once(rng, cause, size) for _ in range(runs)]
    errors = np.array([one.error for one, _ in found])
    angle = float(np.sqrt(np.mean([angle**2 for _, angle in found])))
    ground = HEIGHT * float(np.tan(angle))
    return Cause(cause, CAUSES[cause][0], size, float(errors.mean()), _standard_error(errors), angle, ground)


def explain(rng: np.random.Generator, cause: str, runs: int) -> Cause:
    """How large one cause must be to leave the printed error, and what it then does.

    Parameters
    ----------
    rng
        For poses and errors.
    cause
        One of `CAUSES`.
    runs
        How many calibrations; half as many to find the size.

    Returns
    -------
    Cause
    """
    _, size = CAUSES[cause]
    for _ in range(2):  # what is left grows with the size, nearly in proportion
        tried = np.array([calibrate_once(rng, cause, size)[0].error for _ in range(max(runs // 2, 2))])
        size *= PRINTED_ERROR / float(tried.mean())
    found = try_cause(rng, cause, size, runs)
    # What chance does to the size that was found counts as well: it is proportional.
    scaled = _standard_error(tried * PRINTED_ERROR / tried.mean())
    return found._replace(left_error=float(np.linalg.norm([found.left_error, scaled])))


def _standard_error(values: Array) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan


def printed_angles(found: Mounting) -> tuple[float, float, float]:
    """Roll, tilt and pan (radians) of a mount in the sense in which H 5.6.1 prints them."""
    return helgesen_misalignment(*found.mount.misalignment)


def error_from_height() -> Interval:
    """The printed error taken for one of orientation, at the height of the flight: H 5.6.1 has 6.6 m.

    Returns
    -------
    Interval
        Bounds are of what the printed error and range were rounded from, metres.
    """
    given = [PRINTED_ERROR, PRINTED_RANGE]
    low, high = propagate_rounding(lambda one: one[0] * HEIGHT / one[1], given, [0.00005, 0.05])
    return Interval(PRINTED_ERROR * HEIGHT / PRINTED_RANGE, float(low), float(high))


class Recorded(NamedTuple):
    """A number of ``metrics.json``."""

    name: str
    subject: str
    value: float
    unit: str
    n: int | None = None
    low: float | None = None
    high: float | None = None


def metrics_of(
    calibrated: pd.DataFrame, causes: Sequence[Cause], mounted: Sequence[Mounting]
) -> list[Recorded]:
    """What is recorded.

    Parameters
    ----------
    calibrated
        From `calibrations`.
    causes
        From `explain`, that of the clicks first.
    mounted
        Calibrations whose angles are compared with the printed ones.
    """
    sheet, focal, height = theoretical(), theoretical_focal_length(), error_from_height()
    n, angles = len(calibrated), np.degrees([printed_angles(one) for one in mounted]).T
    found = [
        Recorded("focal_length", "data-sheet", focal.estimate, "px", low=focal.low, high=focal.high),
        Recorded("centre_column", "data-sheet", sheet.cx, "px"),
        Recorded("centre_row", "data-sheet", sheet.cy, "px"),
        Recorded("offset_columns", "tau2-data-sheet", abs(TAU2.cx - sheet.cx), "px"),
        Recorded("offset_rows", "tau2-data-sheet", abs(TAU2.cy - sheet.cy), "px"),
    ]
    for name in PINHOLE:
        values = calibrated[name].to_numpy(float)
        sd = values.std(ddof=1)
        found += [
            Recorded(name, "tau2", values.mean(), "px", n),
            Recorded(error_name(name), "tau2", sd / n**0.5, "px", n),
            Recorded(f"sd_{name}", "tau2", sd, "px", n),
        ]
    for name, values in zip(("roll", "tilt", "pan"), angles, strict=True):
        count = len(values)
        found += [
            Recorded(name, "mounting", values.mean(), "deg", count),
            Recorded(error_name(name), "mounting", values.std(ddof=1) / count**0.5, "deg", count),
        ]
    return [
        *found,
        Recorded("error_left", "mounting", causes[0].left, "m", n),
        Recorded(error_name("error_left"), "mounting", causes[0].left_error, "m", n),
        Recorded("error_at_350_m", "mounting", height.estimate, "m", low=height.low, high=height.high),
    ]


def parameters_table(calibrated: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """The camera's parameters as printed; their mean, spread, predicted spread and coverage (%)."""
    return pd.DataFrame(
        [
            {
                "parameter": names[name],
                "published": getattr(TAU2, name),
                "mean": calibrated[name].mean(),
                "spread": calibrated[name].std(ddof=1),
                "predicted": calibrated[f"sd_{name}"].mean(),
                "inside": 100 * calibrated[f"inside_{name}"].mean(),
            }
            for name in PINHOLE
        ]
    )


def causes_table(causes: Sequence[Cause]) -> pd.DataFrame:
    """What each cause leaves, and what it does from the height of the flight; angles in degrees."""
    return pd.DataFrame([{**one._asdict(), "angle": np.degrees(one.angle)} for one in causes])


def circle_grid(centres: Centres, calibrated: pd.DataFrame) -> Figure:
    """One of the rendered images with its centres, and the principal points of all calibrations."""
    fig, axes = new_figure(5.9, 3.1, columns=2)
    axes[0].imshow(centres.image, cmap="gray")
    axes[0].plot(*centres.uv.T, "+", color=VERMILLION, ms=5)
    axes[0].set(xlabel="u (px)", ylabel="v (px)", title="Centres found")
    axes[0].grid(visible=False)
    draw_dots(axes[1], calibrated["cx"], calibrated["cy"], BLUE, "calibrations", size=8, alpha=1.0)
    axes[1].plot(TAU2.cx, TAU2.cy, "x", color=INK, ms=8, mew=2, label="truth")
    axes[1].set(ylabel="row (px)", title="Principal point")
    axes[1].set_aspect("equal", "datalim")
    return finish(fig, "principal point, column (px)")


def mounting_causes(causes: Sequence[Cause]) -> Figure:
    """The error on the ground from the height of the flight that each cause makes, and the printed one."""
    grounds = np.array([one.ground for one in causes])
    constant = np.isin([one.name for one in causes], CONSTANT)
    series = {
        name: Values(np.where(which, grounds, np.nan), color=color)
        for name, which, color in (
            ("new in each image", ~constant, BLUE),
            ("the same in all", constant, GREEN),
        )
    }
    least, most = min(*grounds, PRINTED_AT_HEIGHT) / 2, 2 * max(*grounds, PRINTED_AT_HEIGHT)
    limits = {"xscale": "log", "xlim": (least, most)}
    label = "error on the ground from 350 m (m)"
    fig = rows_chart([one.name for one in causes], series, label, size=(5.6, 3.3), apart=0.0, **limits)
    (ax,) = fig.axes
    for row, value in enumerate(grounds):
        ax.annotate(f"{value:.1f} m", (value, row), (0, 8), textcoords="offset points", ha="center")
    ax.axvline(PRINTED_AT_HEIGHT, color=INK, ls="--", lw=1)
    return fig
