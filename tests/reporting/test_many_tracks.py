"""Many targets: charts that can be read, and a verdict and advice that turn with the numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.figure_text import overlapping
from wildlab.analysis.tracks.noise_model import GivenValue
from wildlab.evaluation.identities import Identities, Moment, TargetLife, TrackLife, compare_identities, gospa
from wildlab.messages.catalogue import load_texts
from wildlab.reporting import figures
from wildlab.reporting import many_tracks as page
from wildlab.reporting.charts import tracks as charts
from wildlab.reporting.figures import PHONE_WIDTH, least_size
from wildlab.tracking.multitarget import Shown
from wildlab.tracking.target_model import POINT, Hull


def shown_at(time: int, names: Iterable[int], x: np.ndarray, P: np.ndarray) -> Shown:
    """What is shown at a time: the named tracks, with states (N, 4) of one covariance."""
    n = len(x)
    identity = np.array([*names], int)
    return Shown(
        float(time),
        0,
        identity,
        x,
        np.tile(P, (n, 1, 1)),
        np.ones(n),
        np.ones((n, 1)),
    )


def made(
    seed: int, tracks: int = 9, targets: int = 3, looks: int = 80, name: str = "boat {}"
) -> tuple[Any, Any]:
    """Tracks that come and go beside targets that walk about; the first three are on them."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(1, 300)
    ways = rng.normal(0, size, (targets, 1, 2)) + rng.normal(0, size / 20, (targets, looks, 2)).cumsum(axis=1)
    begin = np.sort(rng.integers(0, looks // 2, tracks))
    names, flags = [name.format(i) for i in range(targets)], np.ones(targets, bool)
    shown, compared = [], []
    for t in range(looks):
        there = np.flatnonzero(begin <= t)
        x = np.pad(rng.normal(0, size, (len(there), 2)), ((0, 0), (0, 2)))
        on = there < targets
        x[on, :2] = ways[there[on], t]
        shown.append(shown_at(t, there, x, np.eye(4)))
        P = shown[-1].P[:, :2, :2]
        compared.append(Moment(float(t), x[:, :2], P, there.tolist(), ways[:, t], names, flags, ~flags))
    platform = rng.normal(0, size / 50, (looks, 2)).cumsum(axis=0)
    followed = SimpleNamespace(
        shown=shown,
        scans=[SimpleNamespace(time=float(t), platform=platform[t]) for t in range(looks)],
        truth=dict(zip(names, ways, strict=True)),
        targets=SimpleNamespace(hulls=(POINT,)),
        cutoff_m=20.0,
    )
    return followed, compare_identities(compared, 20.0)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["tracks", "identities", "wrong"])
def test_letters_can_be_read_and_lie_on_no_others(name, seed):
    given = made(seed)
    figure = getattr(charts, f"{name}_shown")(*given[: 1 if name == "tracks" else 2])[0]
    figures.png_bytes(figure)
    assert overlapping(figure) == []
    assert figure.get_size_inches()[0] * least_size(figure) <= PHONE_WIDTH


def test_names_are_only_text_and_leave_room_for_the_picture():
    followed, lives = made(1, name="<b>a$b_{{$^</b>" + "L" * 60 + "{}")
    figure = charts.identities_shown(followed, lives)[0]
    figures.png_bytes(figure)
    shown = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert shown[0].startswith("<b>a$b_{$^") and all(len(one) <= charts.LONGEST_NAME for one in shown)


def followed(tracks: int = 2, looks: int = 61) -> Any:
    P = np.eye(4)
    return SimpleNamespace(
        shown=[shown_at(t, range(tracks), np.zeros((tracks, 4)), P) for t in range(looks)],
        scans=[SimpleNamespace(time=float(t)) for t in range(looks)],
        minutes=(looks - 1) / 60,
        targets=SimpleNamespace(hulls=(POINT,)),
        cutoff_m=20.0,
        others=False,
    )


def lives(**changes: Any) -> Identities:
    """Two targets at 61 looks, tracks 3 m off."""
    each = gospa([[0.0, 0.0], [50.0, 0.0]], [[3.0, 0.0], [50.0, 3.0]], 20.0)
    base: dict[str, Any] = {
        "gospa": [each] * 61,
        "followed": [{"a": 0, "b": 1}] * 61,
        "swaps": 0,
        "breaks": 0,
        "false_tracks_per_minute": 0.0,
        "targets": {"a": TargetLife(61, 1.0, 0.0, 0, 0), "b": TargetLife(61, 0.95, 2.0, 0, 0)},
        "tracks": {0: TrackLife(61, 61, 2.0, False, 61), 1: TrackLife(61, 61, 2.2, False, 61)},
    }
    return Identities(**(base | changes))


FALSE = {0: TrackLife(9, 9, 2.0, False, 9), 1: TrackLife(9, 0, np.nan, True)}
FEW = {0: TrackLife(9, 4, 9.0, False, 4), 1: TrackLife(9, 9, np.nan, False, 0)}


def test_numbers_of_the_summary():
    assert page.rms_error(lives()) == pytest.approx(3.0)
    assert page.on_target(lives()) == 2 * 61
    assert page.count_tracks(followed()) == 2
    none = gospa([[0.0, 0.0]], np.empty((0, 2)), 20.0)
    never = lives(gospa=[none] * 61, targets={"a": TargetLife(61, 0.0, np.nan, 0, 0)})
    assert page.on_target(never) == 0 and np.isnan(page.rms_error(never))


def test_a_track_that_goes_on_without_its_target_is_seen():
    """On a target for most of its looks, and on nothing at 40 of 100: no sound page."""
    on = gospa([[0.0, 0.0]], [[1.0, 0.0]], 20.0)
    off = gospa(np.empty((0, 2)), [[1.0, 0.0]], 20.0)
    gone = lives(
        gospa=[on] * 60 + [off] * 40,
        targets={"a": TargetLife(60, 1.0, 0.0, 0, 0)},
        tracks={0: TrackLife(100, 60, 2.0, False, 60)},
    )
    assert page.false_share(gone) == pytest.approx(0.4)
    assert page.reason(followed(looks=100), gone).key == "reason-nothing"


def test_names_are_only_text():
    values = [
        GivenValue("targets", "kinds", "**bold** `code`", "stated"),
        GivenValue("radar", "x", "1", "assumed"),
    ]
    table = page.parameters_table(values)
    assert table["of"].tolist() == ["radar", "targets"]  # first what nobody stated
    assert not set("*`") & set(table["value"].iloc[1])
    changes = {"targets": {"**x**": TargetLife(61, 0.5, 0.0, 0, 0), "b": TargetLife(61, 0.6, 0.0, 0, 0)}}
    assert "*" not in page.answer(followed(), lives(**changes))[0].values["target"]


NEVER = {"a": TargetLife(61, 0.0, np.nan, 0, 0), "b": TargetLife(61, 1.0, 0.0, 0, 0)}
SHORT = {"a": TargetLife(61, 0.7, 0.0, 0, 0)}
LOST = TargetLife(61, 0.4, 0.0, 0, 0)
OUT = {"a": TargetLife(0, np.nan, np.nan, 0, 0)}
SAID = ["several", "identities"]


def one_track(nees: float) -> Any:
    return lives(tracks={0: TrackLife(9, 9, nees, False, 9)})


@pytest.mark.parametrize(
    ("one", "two", "keys", "reason", "level", "word"),
    [
        (followed(), lives(), SAID, "sound", "good", "sound"),
        (followed(), lives(targets=SHORT), ["one", "identities"], "short", "warn", "look closer"),
        (followed(), lives(targets=NEVER), ["never", "identities"], "never", "bad", "targets lost"),
        (followed(), lives(targets={"a": NEVER["a"]}), ["never-any", "identities"], "never", "bad",
         "targets lost"),
        (followed(), lives(targets=NEVER | {"a": LOST}, breaks=1), SAID, "lost", "bad", "targets lost"),
        (followed(), lives(targets=OUT), ["none-in-reach"], "unjudged", "neutral", "not judged"),
        (followed(), None, ["no-truth"], "unjudged", "neutral", "not judged"),
        (followed(0), lives(), ["no-track"], "none", "bad", "no track"),
        (followed(), lives(swaps=1, breaks=1), SAID, "swaps", "bad", "mixed up"),
        (followed(), lives(breaks=1), SAID, "breaks", "warn", "look closer"),
        (followed(), lives(tracks=FALSE), SAID, "false", "warn", "look closer"),
        (followed(), lives(tracks=FEW), SAID, "few", "warn", "look closer"),
        (followed(), one_track(9.0), SAID, "overconfident", "warn", "look closer"),
        (followed(), one_track(0.5), SAID, "conservative", "warn", "look closer"),
    ],
)  # fmt: skip
def test_answer_reason_and_verdict_turn_with_the_numbers(one, two, keys, reason, level, word):
    why = page.reason(one, two)
    said, texts = [*page.answer(one, two), why], load_texts("tracking-many")
    assert [message.key for message in said] == [*keys, f"reason-{reason}"]
    for message in said:
        assert set(re.findall(r"{(\w+)}", texts.answers[message.key])) <= set(message.values)
    colour, key = page.verdict_of(why)
    assert (colour, texts.subjects[f"verdict-{key}"]) == (level, word)


def test_what_counts_as_on_a_target_must_hold_honest_errors_and_whole_hulls():
    """Three standard deviations of the tracks, and the longest hull: else a larger reach is advised."""
    for sd, hulls, reach in ((1.0, (), 0), (7.0, (), 21), (1.0, (Hull("ferry", 60.5, 12.0),), 61)):
        one = followed()
        one.targets = SimpleNamespace(hulls=(POINT, *hulls))
        for look in one.shown:
            look.P[:, 0, 0] = sd**2
        for cutoff, advised in ((20.0, bool(reach)), (max(reach, 20.0) + 1.0, False)):
            one.cutoff_m = cutoff
            second = page.answer(one, lives())[1]
            assert (second.key == "reach") == advised
            assert not advised or second.values["reach"] == str(reach)
