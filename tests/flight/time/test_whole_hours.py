"""Whole and half hours between two clocks are found by overlap, and said with what to type."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.flight.card.test_images import START, TAKEN, images, own
from tests.flight.card.test_roles import log
from wildlab.flight.card.images import clock_of_images
from wildlab.flight.card.roles import choose_roles
from wildlab.flight.time.whole_hours import whole_hours


@given(st.integers(-28, 28).filter(bool), st.floats(60, 1500), st.floats(0, 0.05))
def test_a_flight_of_minutes_tells_every_half_hour(halves, seconds, late):
    flight = (START, START + seconds)
    moved = tuple(one + 1800.0 * halves + late * seconds for one in flight)
    assert whole_hours((moved[0], moved[1]), flight) == -1800.0 * halves


def test_what_several_steps_bring_together_is_not_guessed_and_what_meets_is_left():
    long = (0.0, 6 * 3600.0)
    assert whole_hours((8 * 3600.0, 8 * 3600.0 + 600), long) is None
    assert whole_hours((100.0, 700.0), (0.0, 900.0)) is None
    assert whole_hours((4000.0, 4600.0), (0.0, 600.0)) is None
    assert whole_hours(None, (0.0, 600.0)) is None


@pytest.mark.parametrize("hours", [1, -1, -5.5])
def test_images_a_zone_off_say_what_to_type(hours):
    stamps = TAKEN + 3600.0 * hours
    clock = clock_of_images(images(stamps, stamps), own(), None)
    assert f"--camera-offset {-3600.0 * hours:g} " in clock.said
    assert clock.offset_s == 0.0  # whose clock it is nobody knows: it is said, and not done
    after = clock_of_images(images(stamps, stamps), own(), -3600.0 * hours)
    right = clock_of_images(images(TAKEN, TAKEN), own(), None)
    assert "--camera-offset" not in after.said + right.said


@pytest.mark.parametrize(("seconds", "said"), [(3600.0, True), (-1800.0, True), (2500.0, False)])
def test_another_log_a_zone_off_says_what_to_write(seconds, said):
    boat, drone = log("boat", north=80.0, begin=seconds), log("drone", attitude=True)
    (why,) = (one.why for one in choose_roles((boat, drone), {}) if one.found.name == "boat")
    assert (f"offset_s = {-seconds:g}" in why) is said
