"""All pairs of numbers that H prints in two places, with their arithmetic and with what differs."""

from __future__ import annotations

from collections.abc import Callable

from wildlab.studies.printed_numbers import filters, flights
from wildlab.studies.printed_numbers.item import Item, Printed, load_printed

ITEMS: tuple[Callable[[Printed], Item], ...] = (
    flights.noise_by_altitude,
    flights.mean_within_two_metres,
    flights.images_in_view,
    flights.frame_rate,
    flights.images_of_the_first_case,
    flights.altitude_of_the_slow_vessel,
    flights.error_put_down_to_the_reference,
    filters.noise_in_metres,
    filters.nis_of_two_noises,
    filters.nis_of_two_poses_fast,
    filters.nis_of_two_poses_slow,
    filters.the_same_filter_twice,
)


def all_items(printed: Printed | None = None) -> list[Item]:
    """Every pair, in the order of the thesis's subjects.

    Parameters
    ----------
    printed
        Left out, what is published.
    """
    numbers = load_printed() if printed is None else printed
    return [make(numbers) for make in ITEMS]
