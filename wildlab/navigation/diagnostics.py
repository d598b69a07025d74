"""Signs that an estimate should not be believed, in sentences.

A filter always answers. Wrong units, flipped axes or two clocks make measurements that do not go with each
other, and that shows in what the filter had to leave out, force or explain by biases.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.geometry.frames import quaternion_to_matrix
from wildlab.navigation import kernels
from wildlab.navigation.aiding import Aiding
from wildlab.navigation.mekf import FORCED, REJECTED, Navigation

NAMES = {kernels.POSITION: "positions", kernels.VELOCITY: "velocities", kernels.HEADING: "headings"}
#: From where on each sign counts; good flights stay well below.
LEFT_OUT, TOO_LARGE, OUTAGE_S = 0.05, 3.0, 10.0
ACCELEROMETER_BIAS, GYRO_BIAS = 1.5, 0.09  # m/s^2 and rad/s: more than sensors that work have


def signs_of_trouble(found: Navigation, aiding: Sequence[Aiding]) -> list[str]:
    """Sentences about an estimate, worst first; none where nothing is wrong.

    Parameters
    ----------
    found, aiding
        What `mekf.run_mekf` gave, and what it was given.

    Returns
    -------
    list of str

    Raises
    ------
    ValueError
        Where there are not as many sources of aiding as the estimate had.
    """
    return [*_misfits(found, aiding), *_biases(found), *_postures(found), *_absences(found, aiding)]


def _misfits(found: Navigation, aiding: Sequence[Aiding]) -> list[str]:
    sentences = []
    for index, source in enumerate(aiding):
        mine = found.innovations.source == index
        if not mine.any():
            continue
        name = f"{NAMES[source.kind]} of source {index + 1}"
        verdict, nis = found.innovations.verdict[mine], found.innovations.nis[mine]
        forced, left_out = int((verdict == FORCED).sum()), float((verdict == REJECTED).mean())
        # The median, which a few outliers do not move: that of chi-square with 3 (1) degrees of freedom.
        ratio = float(np.median(nis)) / (0.455 if source.kind == kernels.HEADING else 2.366)
        if forced:
            sentences.append(
                f"The filter lost its way {'once' if forced == 1 else f'{forced} times'} and had to be "
                f"widened until the {name} fitted: check units, axes and clocks of the inertial sensors."
            )
        if left_out > LEFT_OUT:
            sentences.append(f"{100 * left_out:.0f} % of the {name} did not fit and were left out.")
        if not ratio <= TOO_LARGE:
            sentences.append(
                f"The {name} miss what the filter expects by {np.sqrt(ratio):.1f} times what it allows: "
                "either the noise is larger than stated, or clocks, units, axes or lever arms are wrong."
            )
    return sentences


def _biases(found: Navigation) -> list[str]:
    sentences = []
    for name, bias, limit, unit in (
        ("accelerometers", found.accelerometer_bias, ACCELEROMETER_BIAS, "m/s^2"),
        ("gyros", found.gyro_bias, GYRO_BIAS, "rad/s"),
    ):
        size = np.linalg.norm(bias[np.isfinite(bias).all(axis=1)], axis=1)
        if len(size) and np.quantile(size, 0.9) > limit:
            sentences.append(
                f"The bias of the {name} comes out as {np.quantile(size, 0.9):.2g} {unit}, more than sensors "
                "that work have: check their units and axes."
            )
    return sentences


def _postures(found: Navigation) -> list[str]:
    """All axes turned alike make an estimate that fits, of an airframe that flies in a way none does."""
    v = found.velocity
    fast = np.isfinite(v).all(axis=1) & (np.linalg.norm(v, axis=1) > 5.0)
    if not fast.any():
        return []
    R, course = quaternion_to_matrix(found.quaternion[fast]), v[fast]
    along = (R[:, :, 0] * course).sum(axis=1) / np.linalg.norm(course, axis=1)
    sentences = []
    if np.median(R[:, 2, 2]) < 0:
        sentences.append(
            "It flies on its back most of the time: the z axis of the inertial sensors points up, "
            "rather than down."
        )
    if np.median(along) < -0.5:
        sentences.append(
            "It flies tail first most of the time: the x axis of the inertial sensors points back."
        )
    return sentences


def _absences(found: Navigation, aiding: Sequence[Aiding]) -> list[str]:
    sentences = []
    for gap in found.gaps:
        sentences.append(
            f"Inertial samples are missing from {gap.start:.2f} to {gap.end:.2f} s; "
            "nothing is known in between."
        )
    for index, (source, unused) in enumerate(zip(aiding, found.unused, strict=True)):
        if unused > 0.5 * len(source.times):
            sentences.append(
                f"{unused} of {len(source.times)} {NAMES[source.kind]} of source {index + 1} lie outside the "
                "inertial samples: check that both are on the same clock."
            )
    known = found.times[np.isfinite(found.position).all(axis=1)]
    if len(known):
        used = found.innovations.times[found.innovations.verdict != REJECTED]
        marks = np.concatenate([[known[0]], np.unique(used), [known[-1]]])
        longest = int(np.argmax(np.diff(marks)))
        if marks[longest + 1] - marks[longest] > OUTAGE_S:
            sentences.append(
                f"From {marks[longest]:.0f} to {marks[longest + 1]:.0f} s no measurement was used: "
                "the estimate is dead reckoning there, with the uncertainty that it says."
            )
    return sentences
