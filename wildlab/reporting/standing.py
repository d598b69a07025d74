"""The word on top of a study: how its numbers and claims stand to the printed ones, all together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from wildlab.evaluation.printed import AGREES, DIFFERS, POSSIBLE, TOO_VAGUE
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDED

#: As printed, in all that could be told; in part; in less than half of it.
AS_PRINTED, IN_PART, NOT_AS_PRINTED = "as printed", "partly as printed", "not as printed"
#: Nothing could be told.
OPEN, ALONE = "undecided", "not compared"
LEVELS = {AS_PRINTED: "good", IN_PART: "warn", NOT_AS_PRINTED: "bad", OPEN: "neutral", ALONE: "neutral"}


class Standing(NamedTuple):
    """A verdict in a word or two, why, and the colour that goes with the word (`Report.summary`)."""

    word: str
    reason: str
    level: str


def standing(numbers: Iterable[str], claims: Iterable[str]) -> Standing:
    """What single verdicts come to.

    Parameters
    ----------
    numbers
        Of `wildlab.evaluation.printed`, one for each printed number.
    claims
        Of `wildlab.evaluation.shares`, one for each claim.

    Returns
    -------
    Standing
        Verdicts that tell nothing (too vague, undecided, not judged) are counted in no share.

    Examples
    --------
    >>> standing(["agrees", "possible", "differs"], ["holds", "undecided"])
    Standing(word='partly as printed', reason='2 of 3 printed numbers fit, 1 of 1 claim holds; 1 undecided.', level='warn')
    >>> standing([], []).word
    'not compared'
    """  # noqa: E501
    numbers, claims = list(numbers), list(claims)
    fit, off = _count(numbers, AGREES, POSSIBLE), _count(numbers, DIFFERS)
    hold, fail = _count(claims, HOLDS, MOSTLY), _count(claims, FAILS, MOSTLY_NOT)
    vague = _count(numbers, TOO_VAGUE) + _count(claims, UNDECIDED)
    told, good = fit + off + hold + fail, fit + hold
    said = []
    if fit + off:
        said.append(f"{fit} of {fit + off} printed " + ("number fits" if fit + off == 1 else "numbers fit"))
    if hold + fail:
        said.append(f"{hold} of {hold + fail} " + ("claim holds" if hold + fail == 1 else "claims hold"))
    reason = ", ".join(said) + (f"; {vague} undecided" if vague else "") + "."
    if told:
        word = AS_PRINTED if good == told else IN_PART if 2 * good >= told else NOT_AS_PRINTED
    elif vague:
        what = "printed number or claim" if vague == 1 else "printed numbers and claims"
        word, reason = OPEN, f"{vague} {what}, and nothing decides."
    else:
        word, reason = ALONE, "No printed number or claim is judged here."
    return Standing(word, reason, LEVELS[word])


def _count(verdicts: list[str], *of: str) -> int:
    return sum(verdict in of for verdict in verdicts)
