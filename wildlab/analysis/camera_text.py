"""What is said of a calibrated camera, each sentence from the numbers it states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.analysis.camera import CameraCalibration, coverage
from wildlab.geometry.directions import direction_sd
from wildlab.geometry.frames import Array
from wildlab.geometry.intrinsics import Intrinsics, confused

#: A mean gap between boards that is larger than this share of the raster leaves the lens to guesswork.
COVERED = 0.8
#: Fewer views than this give wide intervals.
PLENTY = 15
#: What a focal length may be off by at the corner of the image (1 SD) without a word, pixels.
MATTERS_PX = 0.5
#: Tilts less than this (degrees) hardly tell focal length from distance.
FLAT_DEG = 15.0
#: A direction that is off by more than this (pixels, one standard deviation) at a corner is worth a sentence.
ROUGH_PX = 2.0
#: Names as a reader knows them.
WORDS = {
    "f": "the focal length", "fx": "the focal length of columns", "fy": "the focal length of rows",
    "cx": "the principal point's column", "cy": "the principal point's row", "skew": "the skew",
}  # fmt: skip


def boards_sentence(found: CameraCalibration) -> str:
    """How many boards, and how many of them only once the image was inverted."""
    views, inverted = len(found.views), sum(one.inverted for one in found.views)
    said = f"The board is in {views} of {len(found.images)} images"
    if inverted:
        said += f", in {'all' if inverted == views else inverted} of them light on dark"
    return f"{said}."


def fit_sentence(found: CameraCalibration) -> str:
    """How well it fits, by which lens, and why that one."""
    rms, lens = found.found.rms, found.choice.lens
    said = f"Projected and seen points are {rms:.3f} px apart (root mean square)"
    model = "a lens that does not bend" if lens == "none" else f'the lens model "{lens}"'
    tried = found.choice.held_out
    if not tried:
        return f"{said}, with {model}."
    best = min(tried, key=lambda name: tried[name])
    compared = (
        f"on views held out it is off by {tried[lens]:.3f} px"
        if best == lens
        else f'on views held out it is off by {tried[lens]:.3f} px, and the best, "{best}", by '
        f"{tried[best]:.3f} px, which is no certain gain"
    )
    return f"{said}, with {model}: {compared}."


def coverage_sentence(found: CameraCalibration) -> str:
    """How much of the image the boards cover, and where they do not."""
    held = coverage(found.uv, found.width, found.height)
    share = held.mean()
    said = f"The boards cover {100 * share:.0f} % of the image"
    rows, columns = held.shape
    halves = {
        "upper left": held[: rows // 2, : columns // 2],
        "upper right": held[: rows // 2, columns // 2 :],
        "lower left": held[rows // 2 :, : columns // 2],
        "lower right": held[rows // 2 :, columns // 2 :],
    }
    worst = min(halves, key=lambda name: halves[name].mean())
    if share >= COVERED:
        return f"{said}."
    return f"{said}, least at its {worst} ({100 * halves[worst].mean():.0f} %): hold the board there, too."


def corner_sentence(found: CameraCalibration) -> str:
    """How well directions are known in the middle and at the worst corner."""
    w, h = found.width, found.height
    places = {
        "the middle": (w / 2, h / 2), "the upper left corner": (0.0, 0.0),
        "the upper right corner": (w - 1.0, 0.0), "the lower left corner": (0.0, h - 1.0),
        "the lower right corner": (w - 1.0, h - 1.0),
    }  # fmt: skip
    sd = dict(zip(places, direction_sd(found.found, np.array(list(places.values()))), strict=True))
    blind = [name for name, one in sd.items() if not np.isfinite(one)]
    if blind:
        return f"The lens model does not reach {' and '.join(blind)}: it folds back before."
    worst = max(sd, key=lambda name: sd[name])
    said = (
        "Apart from a turn of the whole camera, where a direction is seen is known to "
        f"{sd['the middle']:.1f} px in the middle"
    )
    if worst == "the middle":
        return f"{said} of the image (one standard deviation), and no worse at the corners."
    advice = ": more views there will help" if sd[worst] > ROUGH_PX else ""
    return f"{said} of the image and to {sd[worst]:.1f} px at {worst} (one standard deviation){advice}."


def tilts_deg(found: Intrinsics) -> Array:
    """By how much the board is tilted against the image in each view, (V,) degrees."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.abs(found.views.rotation[:, 2, 2]), 0, 1))))


def rim_px(found: Intrinsics) -> float:
    """By how much the least certain focal length moves a point at the corner of the image, 1 SD, pixels."""
    sd = np.sqrt(np.diag(found.covariance))
    focal = [name in ("f", "fx", "fy") for name in found.names]
    share = float(np.max(sd[focal] / found.values[focal], initial=0.0))
    return float(share * np.hypot(found.camera.width, found.camera.height) / 2)


def confusion_sentences(found: CameraCalibration) -> list[str]:
    """Which parameters the views cannot tell apart, and what would help."""
    said = []
    for group in confused(found.found):
        names = _listed([WORDS.get(one, one) for one in group])
        what = f"The views cannot tell {names} apart"
        if len(group) == 1:
            what = f"The views hardly tell {names}"
        if set(group) <= {"k1", "k2", "k3"}:
            lens = "k1" if "k3" not in group else "k1-k2"
            said.append(f"{what}: together they say how the lens bends, and --lens {lens} does with fewer.")
        elif set(group) & {"f", "fx", "fy"}:
            # Two focal lengths change together wherever the board stands; it matters where both are vague.
            if rim_px(found.found) < MATTERS_PX:
                continue
            said.append(
                f"{what}: tilt the board more, it is {tilts_deg(found.found).max():.0f} degrees at most."
            )
        else:
            said.append(f"{what}: turn the board by 90 degrees between views, and hold it at the edges.")
    flat = tilts_deg(found.found).max()
    if flat < FLAT_DEG:
        said.append(
            f"The board is tilted by {flat:.0f} degrees at most, which hardly tells focal length from "
            "distance."
        )
    return said


def odd_sentences(found: CameraCalibration) -> list[str]:
    """Views that disagree with the rest, and what becomes of the estimate without them."""
    rest = found.without_odd
    if rest is None:
        return []
    names = [one.name for one in found.views]
    rms = [found.held_out[names.index(name)] for name in found.odd]
    usual = float(np.median([e for n, e in zip(names, found.held_out, strict=True) if n not in found.odd]))
    which = _listed([f"{name} ({error:.2f} px)" for name, error in zip(found.odd, rms, strict=True)])
    moved = ", ".join(
        f"{name} {found.found.value(name):.1f} -> {rest.value(name):.1f}"
        for name in found.found.names
        if name in WORDS
    )
    option = " ".join(f"--without {name}" for name in found.odd)
    said = (
        f"{which} {'disagrees' if len(rms) == 1 else 'disagree'} with the other views, which are typically "
        f"{usual:.2f} px off under the camera that the rest give"
    )
    return [f"{said}. Without: {rest.rms:.3f} px, {moved} ({option})."]


def number_sentence(found: CameraCalibration) -> list[str]:
    """That there are few views, where there are."""
    n = len(found.views)
    if n >= PLENTY:
        return []
    return [f"{n} views make wide intervals: {PLENTY} to 30 from different sides are better."]


def sentences(found: CameraCalibration) -> list[str]:
    """All that is said of a calibration, in order."""
    return [
        boards_sentence(found),
        fit_sentence(found),
        coverage_sentence(found),
        corner_sentence(found),
        *confusion_sentences(found),
        *odd_sentences(found),
        *number_sentence(found),
    ]


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
