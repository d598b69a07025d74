"""Pairs of numbers about the filters: what they are told of their measurements, and what came of it.

What stands in the text of H is typed here, with its section.
"""

from __future__ import annotations

import numpy as np

from wildlab.studies.printed_numbers.arithmetic import off_nadir, pixels_on_ground, rescaled_nis
from wildlab.studies.printed_numbers.item import Item, Printed

#: Mean of the two focal lengths of H (2.3), px.
FOCAL_LENGTH = (1159.2 + 1167.8) / 2


def noise_in_metres(_: Printed) -> Item:
    """H 6.4.2, flight 1: 20 px and 7 m at 350 m."""
    pixels, height, metres = 20.0, 350.0, 7.0
    ground = float(pixels_on_ground(pixels, height, FOCAL_LENGTH))
    return Item(
        "pixels-and-metres",
        "20 pixels on the sea from 350 m",
        (
            (
                "H 6.4.2",
                "“(20 pixels)² for the EKF, which actually corresponds to (7 m)² at the altitude the UAV "
                "kept”",
            ),
            ("H 5.6.1", "“approximately (8.95 × 10⁻⁴ × altitude) m” a pixel"),
        ),
        metres,
        ground,
        "m",
        f"{pixels:.0f} px times {height:.0f} m by the calibrated {FOCAL_LENGTH:.0f} px (H 2.3) are "
        f"{ground:.1f} m, and "
        f"{pixels * 8.95e-4 * height:.1f} m by the rule of H 5.6.1; {metres:.0f} m are "
        f"{metres * FOCAL_LENGTH / height:.0f} px.",
        f"Away from the foot of the aircraft a pixel covers more: {metres:.0f} m along the view at "
        f"{np.degrees(off_nadir(ground, metres)):.0f}° from straight down.",
        (
            "The two filters of flight 1 are told of different noise, and their NIS differ by that too.",
            "The two filters of flight 1 are told of the same noise.",
        ),
    )


def nis_of_two_noises(printed: Printed) -> Item:
    """H 6.4.2, flight 2: NIS of EKF and KF, 30 px and 10 m."""
    pixels, height, metres = 30.0, 300.0, 10.0
    numbers = printed["linear-vs-nonlinear-slow"]
    ekf, kf = numbers["ekf", "nis"], numbers["kf", "nis"]
    ground = float(pixels_on_ground(pixels, height, FOCAL_LENGTH))
    expected = float(rescaled_nis(kf, metres, ground))
    return Item(
        "nis-of-two-noises",
        "NIS of the extended filter on the slow vessel",
        (
            ("H 6.4.2", "“(10 m)² and (30 pixels)²”, “an altitude of nearly 300 m”"),
            ("H table 6.3", f"NIS {ekf:.2f} of the EKF, {kf:.2f} of the KF"),
            ("H 6.4.2", "“most likely because the linearization is more inaccurate in this flight”"),
        ),
        ekf,
        expected,
        "",
        f"{pixels:.0f} px are {ground:.1f} m from {height:.0f} m. With that noise in place of {metres:.0f} "
        "m the "
        f"KF's {kf:.2f} would be up to {expected:.2f}.",
        "The noises that the two filters are told of: the smaller one has the larger NIS. Poses, "
        "detections and "
        "motion model are the same.",
        (
            "The noise alone does not make the difference between the filters; something else has a part "
            "in it.",
            "The noise alone would do: the linearisation need not be a reason.",
        ),
    )


def nis_of_two_poses_fast(printed: Printed) -> Item:
    """H tables 6.2 and 7.5: NIS of the EKF with the observer's and with the MEKF's pose."""
    before, after = 20.0, 30.0
    observer = printed["linear-vs-nonlinear-fast"]["ekf", "nis"]
    mekf = printed["schmidt-fast-vessel"]["ekf", "nis"]
    expected = float(rescaled_nis(observer, before, after))
    return Item(
        "nis-of-two-poses-fast",
        "NIS of the extended filter on the fast vessel at 30 pixels",
        (
            ("H table 6.2", f"NIS {observer:.2f} at 20 pixels, poses of the observer"),
            ("H table 7.5", f"NIS {mekf:.2f} at 30 pixels, poses of the MEKF"),
            (
                "H 7.5.3",
                "“The same tuning is used as in Section 6.4.2 … The only difference is that the covariance "
                "of the measurement noise is increased”",
            ),
        ),
        mekf,
        expected,
        "",
        f"Half as much noise again takes {observer:.2f} down to {expected:.2f} at the least. {mekf:.2f} "
        "means squared "
        f"innovations up to {mekf / expected:.1f} times as large, innovations "
        f"{np.sqrt(mekf / expected):.1f} times.",
        "The source of the poses: the observer in H 6.4.2, flight 1, the MEKF in H 7.5.3. Data and motion "
        "model are "
        "the same.",
        (
            "The remainder is what the MEKF's pose added to the innovations, or less where the filter's "
            "own "
            "uncertainty counts.",
            "The change of the noise makes all of the difference; the poses do not show.",
        ),
    )


def nis_of_two_poses_slow(printed: Printed) -> Item:
    """H tables 6.3 and 7.6: NIS of the EKF with the autopilot's and with the MEKF's pose."""
    autopilot = printed["linear-vs-nonlinear-slow"]["ekf", "nis"]
    mekf = printed["schmidt-slow-vessel-eight"]["ekf", "nis"]
    errors = [
        printed[study]["ekf", "mae"] for study in ("linear-vs-nonlinear-slow", "schmidt-slow-vessel-eight")
    ]
    return Item(
        "nis-of-two-poses-slow",
        "NIS of the extended filter on the slow vessel at 30 pixels",
        (
            ("H table 6.3", f"NIS {autopilot:.2f}, poses of the autopilot, σ_v = 0.01 m/s²"),
            ("H table 7.6", f"NIS {mekf:.2f}, poses of the MEKF, σ_v = 0.05 m/s²"),
            ("H 7.5.4", "“a part of the data used in Section 6.4.2 for the slowly-moving target”"),
        ),
        mekf,
        autopilot,
        "",
        "Both at 30 pixels. The larger σ_v of H 7.5.4 lowers NIS, all else equal. The mean error goes "
        f"from {errors[0]:.2f} to "
        f"{errors[1]:.1f} m.",
        "The source of the poses: the autopilot in H 6.4.2, flight 2, the MEKF in H 7.5.4. Table 7.6 is of "
        "a part of "
        "the data.",
        (
            "What is left is that part of the data, and what the MEKF's pose added or took away.",
            "Pose and part of the data do not show in NIS.",
        ),
    )


def the_same_filter_twice(printed: Printed) -> Item:
    """H tables 6.2 and 7.2: one filter on one flight, printed twice."""
    first, again = (
        printed["linear-vs-nonlinear-fast"]["kf", "mae"],
        printed["coloured-noise-fast"]["cv", "mae"],
    )
    nees = [printed["linear-vs-nonlinear-fast"]["kf", "nees"], printed["coloured-noise-fast"]["cv", "nees"]]
    return Item(
        "the-same-filter-twice",
        "Mean error of the linear filter on the fast vessel",
        (
            ("H table 6.2", f"KF: {first} m, NEES {nees[0]}"),
            ("H table 7.2", f"filter 1: {again} m, NEES {nees[1]}"),
            ("H 7.5.1", "“The same data were used in Section 6.4.2”"),
        ),
        again,
        first,
        "m",
        f"{again} m and {first} m; the mean NEES are {nees[1]} and {nees[0]}.",
        "The standard deviation of the velocity at the start: 10 m/s in H 6.4.2, 100 m/s in H table 7.1.",
        (
            "One filter on one flight gives two results; the start makes the difference.",
            "What is printed twice agrees, and the start does not matter.",
        ),
    )
