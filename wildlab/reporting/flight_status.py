"""The word on top of a study: how its numbers and claims stand to the published ones, all together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wildlab.evaluation.replication import Comparison, Reproduction
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDED

#: As published, in all that was decided; in part; in less than half of it.
AS_PUBLISHED, IN_PART, NOT_AS_PUBLISHED = "as published", "partly as published", "not as published"
#: Less than half was decided; nothing was judged.
OPEN, ALONE = "undecided", "not compared"
LEVELS = {AS_PUBLISHED: "good", IN_PART: "warn", NOT_AS_PUBLISHED: "bad", OPEN: "neutral", ALONE: "neutral"}
#: What is said of several claims with a verdict; of others, that they are not judged.
_CLAIMS = {
    HOLDS: "hold",
    MOSTLY: "hold on most flights",
    UNDECIDED: "undecided",
    MOSTLY_NOT: "fail on most flights",
    FAILS: "do not hold",
}


class Standing(NamedTuple):
    """A verdict in a word or two, why, and the colour that goes with the word (`Report.summary`)."""

    word: str
    reason: str
    level: str


def standing(numbers: Iterable[Comparison], claims: Iterable[str]) -> Standing:
    """What single verdicts come to.

    Parameters
    ----------
    numbers
        Of `wildlab.evaluation.replication`, one for each published number. What was fitted to its number is
        counted apart.
    claims
        Of `wildlab.evaluation.shares`, one for each claim.

    Returns
    -------
    Standing
        Its counts add up to the totals that it gives. It is as published where all that is decided is
        reproduced or holds, and at least half of what is judged is decided.

    Examples
    --------
    >>> standing([], ["holds", "holds", "holds on most flights"])
    Standing(word='partly as published', reason='3 claims: 2 hold, 1 hold on most flights.', level='warn')
    >>> standing([], []).word
    'not compared'
    """
    numbers, claims = list(numbers), list(claims)
    given = Counter(one.reproduction for one in numbers if not one.fitted)
    fitted = Counter(one.reproduction for one in numbers if one.fitted)
    told = Counter(claims)
    good = given[Reproduction.REPRODUCED] + told[HOLDS]
    bad = given[Reproduction.CONTRADICTED] + told[FAILS] + told[MOSTLY_NOT]
    decided = good + bad + told[MOSTLY]
    judged = decided + given[Reproduction.OPEN] + told[UNDECIDED]
    if not judged:
        word = ALONE
    elif 2 * decided < judged:
        word = OPEN
    elif good == decided:
        word = AS_PUBLISHED
    else:
        word = IN_PART if 2 * bad <= decided else NOT_AS_PUBLISHED
    said = []
    for what, counts in (("number", given), ("fitted number", fitted)):
        parts = [f"{counts[one]} {one}" for one in Reproduction if counts[one]]
        said += [_listed(counts.total(), what, parts)] if parts else []
    parts = [f"{told[one]} {words}" for one, words in _CLAIMS.items() if told[one]]
    rest = len(claims) - sum(told[one] for one in _CLAIMS)
    parts += [f"{rest} not judged"] if rest else []
    said += [_listed(len(claims), "claim", parts)] if parts else []
    reason = "; ".join(said) + "." if said else "No published number or claim is judged here."
    return Standing(word, reason, LEVELS[word])


def _listed(total: int, what: str, parts: Sequence[str]) -> str:
    return f"{total} {what}{'s' * (total != 1)}: {', '.join(parts)}"
