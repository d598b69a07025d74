"""Tables 5.1-5.3 of H, and the symmetries any such table must have."""

import numpy as np
import pytest

from wildlab.reporting.published import load_published
from wildlab.studies.sensitivity.tables import TAU2, displacement, helgesen_mount, helgesen_tables

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
    from wildlab.geometry.frames import euler_to_matrix
    from wildlab.geometry.georeference import pixel_to_plane
    from wildlab.geometry.mount import camera_pose

    yaw = np.radians(3.0)
    shift = displacement(
        TAU2, helgesen_mount(), (100.0, 80.0), (0, 0, 0), (0, 0, -100.0), (0, 0, yaw), (0, 0, 0)
    )
    pose = camera_pose(helgesen_mount(), np.array([[0, 0, -100.0]]), euler_to_matrix([0.0], [0.0], [0.0]))
    radius = np.hypot(*pixel_to_plane(TAU2, np.array([[100.0, 80.0]]), *pose, 0.0)[0, :2])
    assert np.isclose(np.hypot(*shift[0]), 2 * radius * np.sin(yaw / 2))
