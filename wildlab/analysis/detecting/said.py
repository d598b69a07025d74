"""What a run of a detector says of its frames, its labels and itself, beside its rates."""

from __future__ import annotations

from wildlab.analysis.detecting.detect import Detected
from wildlab.analysis.detecting.judged import DetectorScore
from wildlab.flight.files import printable
from wildlab.flight.readers.frames import Frames, Polarity
from wildlab.flight.readers.frames.opening import CORRECTIONS

#: Detections an image from which on defaults are said to fit badly: more than anyone looks through.
MANY = 10


def not_judged(judged: DetectorScore) -> list[str]:
    """Sentences on frames and labels that say nothing, or count as missed for a reason of their own.

    Parameters
    ----------
    judged
        A run beside its labels.

    Returns
    -------
    list of str
    """
    said = []
    if judged.without_labels:
        said.append(f"{judged.without_labels} of the frames are not judged: the labels do not name them.")
    if judged.outside:
        said.append(
            f"{judged.outside} labels lie wholly outside their image and count as missed: are they of these "
            "images, at this size?"
        )
    if judged.unusable:
        said.append(f"{judged.unusable} labelled frames could not be used; what is labelled there is missed.")
    if judged.absent:
        first = ", ".join(printable(one) for one in judged.absent[:3])
        more = len(judged.absent) - 3
        said.append(
            f"{len(judged.absent)} labelled frames are not here and count nowhere: {first}"
            + (f" and {more} more." if more > 0 else ".")
        )
    return said


def too_few_or_many(method: str, polarity: Polarity, found: int, usable: int, *, chosen: bool) -> list[str]:
    """What may be wrong where nothing is found, or more than can be looked through.

    Parameters
    ----------
    method, polarity
        As they were asked for.
    found, usable
        Detections, and frames that could be used.
    chosen
        Whether thresholds were chosen for these images.

    Returns
    -------
    list of str

    Examples
    --------
    >>> too_few_or_many("warm", "unknown", 900, 30, chosen=True)
    []
    """
    if not usable:
        return []
    if not found and method != "colour" and polarity != "black-hot":
        return ["Nothing stands out as warm. Where what is warm looks dark, say --polarity black-hot."]
    if found > MANY * usable and not chosen:
        return [
            f"That is {found / usable:.0f} an image: the defaults fit no camera in particular. Sizes follow "
            "from --distance and --focal, and --fit chooses thresholds from labels."
        ]
    return []


def frames_said(frames: Frames, detected: Detected) -> list[str]:
    """Sentences on what was found of the camera itself: its shutter, its pixels, its corners.

    Parameters
    ----------
    frames
        That were looked at.
    detected
        What came out of them.

    Returns
    -------
    list of str
        None of them where there is nothing to be said.
    """
    kept = frames.kept
    said = [f"{note[0].upper()}{note[1:]}." for note in kept.notes]
    problems = detected.frames["problem"].fillna("").astype(str)
    corrections = problems.str.contains("|".join(CORRECTIONS)).sum()
    if corrections:
        said.append(f"Taken during a flat-field correction: {corrections} of {len(problems)} frames.")
    if kept.dead is not None and kept.dead.any():
        number = int(kept.dead.sum())
        word = "1 pixel does not" if number == 1 else f"{number} pixels do not"
        said.append(f"{word} see the scene and {'is' if number == 1 else 'are'} masked.")
    if frames.even and kept.vignetting is None:
        said.append("No fall of brightness towards the corners could be measured, and none is taken off.")
    elif kept.vignetting is not None:
        corner, sd = kept.vignetting.corner, kept.vignetting.sd
        word = "darker" if corner < 0 else "brighter"
        said.append(
            f"The corners are {abs(corner):.3g} (standard deviation {sd:.2g}) {word} than the middle, by "
            f"{kept.vignetting.images} frames; that is taken off."
        )
    return said
