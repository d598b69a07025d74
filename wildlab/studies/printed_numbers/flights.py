"""Pairs of numbers about the flights: heights, images, means, and what an error is put down to.

What stands in the text of H is typed here, with its section.
"""

from __future__ import annotations

import numpy as np

from wildlab.studies.printed_numbers.arithmetic import images_in, rest_of
from wildlab.studies.printed_numbers.item import Item, Printed


def noise_by_altitude(_: Printed) -> Item:
    """H 6.4.4: 17.5 m, 0.05 h and approximately 300 m."""
    noise, share, height = 17.5, 0.05, 300.0
    return Item(
        "noise-by-altitude",
        "Measurement noise of 0.05 h",
        (
            ("H 6.4.4", "“(0.05h) m where h is the altitude of the UAV”"),
            ("H 6.4.4", "“approximately 17.5 m in both north and east”"),
            ("H 6.4.4", "“at an altitude of approximately 300 m”"),
        ),
        noise,
        share * height,
        "m",
        f"{share} times {height:.0f} m is {share * height:.1f} m; {noise} m are {share} of "
        f"{noise / share:.0f} m.",
        "Nothing: it is one flight in one section. H 5.6.1 and 7.5.1 flew at 350 m.",
        (
            "Either the altitude or the noise is another flight's; a filter with the one is not one with "
            "the other.",
            "The noise is that of the altitude.",
        ),
    )


def mean_within_two_metres(printed: Printed) -> Item:
    """H 8.1.1 against table 5.6."""
    numbers = printed["slow-vessel"]
    north, east = (numbers["observer", f"mean_{axis}"] for axis in ("north", "east"))
    other = float(
        np.linalg.norm([numbers["pixhawk-autopilot", f"mean_{axis}"] for axis in ("north", "east")])
    )
    off = float(np.hypot(north, east))
    return Item(
        "mean-within-two-metres",
        "Mean position of the slow vessel",
        (
            ("H 8.1.1", "“the mean position was within two meters from the true position”, of both flights"),
            ("H 5.6.2", "“an overall accuracy just surpassing 2 m”"),
            ("H table 5.6", f"mean errors of {north} m and {east} m with the observer"),
        ),
        off,
        2.0,
        "m",
        f"The length of ({north}, {east}) m is {off:.2f} m; with the autopilot's pose it is {other:.2f} m.",
        "The conclusions speak of both flights at once. Each axis of the observer's mean by itself is "
        f"{'below' if max(abs(north), abs(east)) < 2 else 'not below'} two metres.",
        (
            "As a distance the mean is not within two metres; section 5.6.2 says so itself.",
            "As a distance the mean is two metres, within rounding.",
        ),
    )


def images_in_view(_: Printed) -> Item:
    """H 5.6.3: times out of view and images with a part of the vessel."""
    period, out, rate, images = 80.0, (50 - 20) + (80 - 72), 7.5, 400.0
    seen = period - out
    at_ten = float(images_in(seen, 10.0))
    return Item(
        "images-in-view",
        "Images that show a part of the ship",
        (
            ("H 5.6.3", "“not in the camera field of view in the time intervals [20, 50] s and [72, 80] s”"),
            ("H 5.6.3", "“The camera frame rate was 7.5 Hz”, “600 images were captured”"),
            ("H 5.6.3", "“A part of the vessel was visible in approximately 400 images”"),
        ),
        images,
        float(images_in(seen, rate)),
        "",
        f"{period:.0f} s without {out} s are {seen:.0f} s; at {rate} Hz these are "
        f"{images_in(seen, rate):.0f} "
        f"images, of {images_in(period, rate):.0f} in all. At 10 Hz, the rate that H 6.4.3 gives this "
        "payload, "
        f"they would be {at_ten:.0f}.",
        "The intervals may be those of the ship's middle: of a long ship a part shows before its middle "
        "does. "
        "100 of the images are said to show a very small part only.",
        (
            "A rate of detection per image in view depends on which of the two it is divided by.",
            "Either may be taken for the images in view.",
        ),
    )


def frame_rate(_: Printed) -> Item:
    """H 5.6.3 against 6.4.1 and 6.4.3: one payload."""
    rate, images, seconds = 7.5, 141, 14.0
    return Item(
        "frame-rate",
        "Images per second of the payload without synchronisation",
        (
            ("H 5.6.3", "“The camera frame rate was 7.5 Hz”, “The sensor suite is described in [65]”"),
            (
                "H 6.4.3",
                "“141 images that were captured over a time period of 14 seconds”, “The payload used … "
                "is described in [65]”",
            ),
            (
                "H 6.4.1",
                "“441 images, which correspond to a period of 45 s”, “The payload is described in [65]”",
            ),
        ),
        images / seconds,
        rate,
        "Hz",
        f"{images} images in {seconds:.0f} s are {images / seconds:.1f} a second, 441 in 45 s "
        f"{441 / 45:.1f}.",
        "Not the payload, by its reference; the flights are different ones, and H A.1 says that the "
        "laboratory "
        "has several cameras of this kind.",
        (
            "How long an image's error lasts, counted in images, differs by as much.",
            "The rates are one.",
        ),
    )


def altitude_of_the_slow_vessel(_: Printed) -> Item:
    """H 5.6.2 against 7.5.4, flight 2."""
    low, high, part, whole = 200.0, 300.0, 2400, 3635
    return Item(
        "altitude",
        "Altitude over the slow vessel",
        (
            ("H 5.6.2", "“approximately 200 m during the periods where the vessel was recorded”"),
            ("H 7.5.4", "“uses a part of the data investigated in Section 5.6.2”"),
            ("H 7.5.4", "“an altitude of 200 m to 300 m”, “lower in the first half of the tracking period”"),
        ),
        (low + high) / 2,
        low,
        "m",
        f"The middle of {low:.0f} and {high:.0f} m is {(low + high) / 2:.0f} m. Flight 2 of H 7.5.4 has "
        f"{part} of "
        f"the {whole} detections, {100 * part / whole:.0f} %.",
        "The one is said of the whole flight, the other of a part of it that has most of the detections.",
        (
            "Errors of angles weigh by the height: those of table 5.6 are to be expected larger than 200 m "
            "suggest.",
            "The two heights are one.",
        ),
    )


def error_put_down_to_the_reference(printed: Printed) -> Item:
    """H 5.6.2 against tables 5.4, 7.4 and 7.7."""
    first, total = printed["static-point"]["observer", "mae"], printed["slow-vessel"]["observer", "mae"]
    track = printed["coloured-noise-drifting"]["cv", "mae"]
    later = printed["schmidt-drifting-vessel-eight"]["schmidt", "mae"]
    low, high = (first * height / 350.0 for height in (200.0, 300.0))
    return Item(
        "reference",
        "Error of the reference that table 5.6 would ask for",
        (
            (
                "H 5.6.2",
                f"{total} m compared to {first:.2f} m, “explained by the reference, which is more uncertain”",
            ),
            ("H 5.6.2", "“the error in the reference is potentially a few meters”"),
            ("H table 7.4", f"estimates {track} m off, against the same kind of receiver"),
            ("H table 7.7", f"estimates {later} m off, on a part of the same data"),
        ),
        float(rest_of(total, low)),
        track,
        "m",
        f"Angles that make {first:.2f} m from 350 m make {low:.1f} m from 200 m and {high:.1f} m from 300 "
        "m. "
        f"Independent errors add in squares, so the rest of {total} m is {rest_of(total, low):.1f} m, or "
        f"{rest_of(total, high):.1f} m. An estimate that is {track} m off against a receiver, on average, "
        "holds no larger error of that receiver, as long as the two err independently.",
        "H 5.6.2 names two other reasons beside the reference: the vessel moves, and the receiver is not "
        "in its "
        "middle. The flight of table 7.4 is called an independent one; its vessel, receiver rate (0.5 Hz) "
        "and "
        "pattern are the same.",
        (
            f"The reference alone does not make the difference: {rest_of(total, track):.1f} m of error in "
            "images "
            "are left even if all of the estimates' error in table 7.4 were the receiver's.",
            "A reference as far off as the estimates of table 7.4 makes the difference.",
        ),
    )


def images_of_the_first_case(_: Printed) -> Item:
    """H 5.6.1: 25 min at 7.5 Hz and nearly 8000 images."""
    minutes, rate, images = 25.0, 7.5, 8000.0
    return Item(
        "images-of-the-first-case",
        "Images of the flight over the antenna",
        (
            ("H 5.6.1", "“Nearly 8000 images were captured”, “approximately 25 min”"),
            ("H table A.1", "7.5 Hz"),
        ),
        images,
        float(images_in(60 * minutes, rate)),
        "",
        f"{minutes:.0f} min at {rate} Hz are {images_in(60 * minutes, rate):.0f} images; {images:.0f} are "
        f"{images / rate / 60:.0f} min.",
        "Storage can be turned on and off in flight (H 2.3).",
        (
            "The camera recorded during a part of the flight.",
            "The camera recorded all of the flight.",
        ),
    )
