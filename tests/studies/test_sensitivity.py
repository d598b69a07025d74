"""Tables 5.1-5.3 of H, and the symmetries any such table must have."""

from itertools import permutations, product

import numpy as np
import pandas as pd
import pytest

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount, helgesen_misalignment
from wildlab.geometry.frames import euler_to_matrix, matrix_to_euler
from wildlab.reporting.published import judge, load_published
from wildlab.studies.sensitivity import (
    IMAGE_CENTRE,
    PRINTED_MISALIGNMENT_DEG,
    TAU2,
    displacement,
    helgesen_mount,
    helgesen_tables,
    rounded_tables,
)

PUBLISHED = load_published("sensitivity")


def test_all_42_numbers_are_typed():
    assert len(PUBLISHED) == 42
    assert set(PUBLISHED.subject) == set(helgesen_tables())


@pytest.mark.parametrize("row", list(PUBLISHED.itertuples()), ids=lambda row: row.subject)
def test_every_printed_number_comes_out(row):
    assert abs(helgesen_tables()[row.subject] - row.value) <= 0.15


def test_attitude_errors_grow_with_altitude_and_position_errors_do_not():
    table = helgesen_tables()
    for subject, value in table.items():
        attitude, offset, altitude = subject.split("/")
        if altitude == "400m":
            factor = value / table[f"{attitude}/{offset}/100m"]
            assert np.isclose(factor, 1 if offset in ("north", "east", "down") else 4)


def test_a_shift_of_the_airframe_shifts_the_point():
    shift = displacement(
        TAU2, helgesen_mount(), (50.0, 400.0), (0.1, -0.2, 1.0), (0, 0, -80.0), (0, 0, 0), (3, -4, 0)
    )
    assert np.allclose(shift, [[3, -4]])


def test_a_yaw_error_turns_the_point_about_the_foot():
    """3 deg of yaw in level flight moves the point along a circle about the point below the airframe."""
    from wildlab.geometry.camera_poses import camera_pose
    from wildlab.geometry.georeference import pixel_to_plane

    yaw = np.radians(3.0)
    shift = displacement(
        TAU2, helgesen_mount(), (100.0, 80.0), (0, 0, 0), (0, 0, -100.0), (0, 0, yaw), (0, 0, 0)
    )
    pose = camera_pose(helgesen_mount(), np.array([[0, 0, -100.0]]), euler_to_matrix([0.0], [0.0], [0.0]))
    radius = np.hypot(*pixel_to_plane(TAU2, np.array([[100.0, 80.0]]), *pose, 0.0)[0, :2])
    assert np.isclose(np.hypot(*shift[0]), 2 * radius * np.sin(yaw / 2))


def test_rounded_inputs_move_the_tables_as_far_as_the_corners_of_their_box():
    """The bounds of two numbers beside all 128 corners of what camera and angles are rounded from."""
    rounded, exact = rounded_tables(), helgesen_tables()
    half = np.array([0.05, 0.05, 0.5, 0.5, 0.05, 0.05, 0.05])
    given = np.array([TAU2.fx, TAU2.fy, TAU2.cx, TAU2.cy, *PRINTED_MISALIGNMENT_DEG])
    shift = {"level/yaw/100m": ((0, 0, 0), 2), "turn/roll/100m": ((25, 0, 0), 0)}
    for name, (euler, axis) in shift.items():
        found = []
        for signs in product((-1, 1), repeat=7):
            inputs = given + np.array(signs) * half
            mount = Mount("down", misalignment=helgesen_misalignment(*np.radians(inputs[4:])))
            moved = displacement(
                Camera(640, 512, *inputs[:4]), mount, IMAGE_CENTRE, np.radians(euler), (0, 0, -100.0),
                np.radians(3.0) * np.eye(3)[axis], (0, 0, 0),
            )  # fmt: skip
            found.append(float(np.hypot(*moved[0])))
        assert rounded[name] == pytest.approx((min(found), max(found)), abs=0.002)
        assert rounded[name][0] < exact[name] < rounded[name][1]
    assert rounded["level/north/100m"] == pytest.approx((10.0, 10.0))


def test_the_print_contradicts_itself_where_it_is_rounded_to_nearest_and_not_within_one():
    """An attitude's error grows in proportion to height: 100 m and 400 m are one number, told twice."""
    rows = load_published("sensitivity").set_index("subject")["value"]
    moved = ("north", "east", "down")
    turned = [name for name in rows.index if name.endswith("/100m") and name.split("/")[1] not in moved]

    def contradicted(digit: float) -> list[str]:
        pairs = {name: (rows[name], rows[name.replace("100m", "400m")]) for name in turned}
        return [name for name, (near, far) in pairs.items() if abs(4 * near - far) > 5 * digit + 1e-9]

    assert contradicted(0.05) == ["level/yaw/100m"] and contradicted(0.1) == []


def test_all_42_numbers_are_close_by_the_rounding_of_results_and_inputs():
    rounded, exact = rounded_tables(), helgesen_tables()
    for row in load_published("sensitivity").to_dict("records"):
        low, high = rounded[row["subject"]]
        found = {"value": exact[row["subject"]], "low": low, "high": high}
        ours = {("horizontal_error", row["subject"]): found}
        compared = judge(row, ours)
        assert compared is not None and compared.words == "close", row["subject"]
        # One hundredth of the result beyond what rounding leaves open is seen.
        far = exact[row["subject"]] + row["rounding"] * 2.5 + 0.02 * row["value"]
        assert judge(row, {("horizontal_error", row["subject"]): {"value": far}}).words == "not close"


def test_the_signs_of_the_mounting_angles_are_those_nearest_to_the_print():
    """H prints three angles and not how they combine: in every order, ours have the smallest differences."""
    printed = PUBLISHED.set_index("subject")["value"]
    axes = {"roll": (1, 0, 0), "tilt": (0, 1, 0), "pan": (0, 0, 1)}
    found = {}
    for order, signs in product(permutations(axes), product((1, -1), repeat=3)):
        angles = dict(zip(axes, np.radians(PRINTED_MISALIGNMENT_DEG) * signs, strict=True))
        turns = [euler_to_matrix(*(angles[name] * np.array(axes[name]))) for name in order]
        roll, tilt, pan = (float(one) for one in matrix_to_euler(np.linalg.multi_dot(turns)))
        table = pd.Series(helgesen_tables(mount=Mount("down", misalignment=(roll, tilt, pan))))
        found[order, signs] = float(np.abs(table - printed).max())
    nearest = sorted(found, key=lambda way: found[way])[:6]
    assert {signs for _, signs in nearest} == {(-1, 1, -1)} and len(found) == 48
    ours = np.abs(pd.Series(helgesen_tables()) - printed).max()
    assert found[("pan", "tilt", "roll"), (-1, 1, -1)] == pytest.approx(ours)
