"""Kept seeds that are not as they were written: none is read, each is computed again, and the run says so."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.runner.processes.job import Job
from wildlab.runner.processes.scheduling import _Scheduler, _waiting
from wildlab.runner.processes.worker_pool import SeedResult, WorkerPool
from wildlab.runner.seeds import (
    SeedWork,
    again_words,
    faults,
    missing_seeds,
    other_seeds,
    read_seed,
    seed_digest,
    set_aside,
    sweep_seeds,
    take_stock,
    write_seed,
)

VALUES = {
    "schmidt/nees_inside": 0.9333333333333333,
    "schmidt/median_nees": 3.25e-7,
    "ekf/max_error": 1.0,
    "ekf/none": math.nan,
    "ekf/beyond": -math.inf,
    "ekf/zero": -0.0,
}


def work(folder: Path, *seeds: int, key: str = "k") -> SeedWork:
    return SeedWork(folder, "study", "case", {"twin": "t"}, "code", key, seeds or (1, 2, 3))


def rewrite(change: Callable[[dict[str, Any]], object]) -> Callable[[str], str]:
    """A damage that leaves a file laid out as it was."""

    def changed(text: str) -> str:
        content = json.loads(text)
        change(content)
        return json.dumps(content, indent=1) + "\n"

    return changed


@given(
    values=st.dictionaries(
        st.text("abc_-", min_size=1, max_size=4).map("s/{}".format), st.floats(), min_size=1, max_size=4
    ),
    place=st.integers(0, 10**6),
    bit=st.integers(0, 7),
)
def test_nor_is_one_in_any_numbers(tmp_path_factory, values, place, bit):
    one = work(tmp_path_factory.getbasetemp() / "bits", 1)
    write_seed(one, 1, values)
    turned = bytearray((one.folder / "1.json").read_bytes())
    turned[place % len(turned)] ^= 1 << bit
    (one.folder / "1.json").write_bytes(bytes(turned))
    assert read_seed(one, 1) is None


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: text[:-1],
        lambda text: text[: len(text) // 2],
        lambda text: text + "\n",
        lambda text: "[" * 5000,
        lambda text: "[]",
        lambda text: "1",
        lambda text: text.replace("0.9333333333333333", "0.8333333333333333"),
        lambda text: text.replace("3.25e-07", "0.000000325"),
        lambda text: text.replace('"nan"', "NaN"),
        rewrite(lambda content: content["values"].pop("ekf/zero")),
        rewrite(lambda content: content["values"].update({"ekf/more": 1.0})),
        rewrite(lambda content: content["values"].update({"ekf/zero": 0.0})),
        rewrite(lambda content: content["names"].pop()),
        rewrite(lambda content: content.pop("digest")),
        rewrite(lambda content: content.update(seed=2)),
        rewrite(lambda content: content.update(case="another")),
    ],
)
def test_whatever_was_done_to_a_file_it_is_not_read(tmp_path, damage):
    one = work(tmp_path)
    write_seed(one, 1, VALUES)
    path = one.folder / "1.json"
    assert missing_seeds(one) == [2, 3]
    text = damage(path.read_text())
    assert text != path.read_text()
    path.write_text(text)
    assert read_seed(one, 1) is None and take_stock(one).damaged == (1,) and missing_seeds(one) == [1, 2, 3]


def test_a_file_of_another_key_study_or_seed_is_not_read(tmp_path):
    one, other = work(tmp_path), work(tmp_path, key="another")
    for its in (one, other):
        for seed in its.seeds:
            write_seed(its, seed, VALUES)
    shutil.copy(other.folder / "1.json", one.folder / "1.json")
    shutil.copy(one.folder / "3.json", one.folder / "2.json")
    assert take_stock(one).damaged == (1, 2) and read_seed(one, 3) is not None
    assert take_stock(replace(one, case="another")).damaged == (1, 2, 3)


def test_a_file_without_a_digest_counts_as_absent(tmp_path):
    one = work(tmp_path, 1)
    one.folder.mkdir(parents=True)
    (one.folder / "1.json").write_text('{"case": "case", "seed": 1, "values": {"a/b": 1.0}}')
    assert take_stock(one) == ((1,), (), ()) and read_seed(one, 1) is None


def test_a_digest_is_of_all_that_is_said_and_of_nothing_else(tmp_path):
    one = work(tmp_path, 1)
    turned = dict(reversed(VALUES.items()))
    assert seed_digest(one, 1, VALUES) == seed_digest(replace(one, study="b", code="c"), 1, turned)
    others = [
        seed_digest(one, 2, VALUES),
        seed_digest(replace(one, key="l"), 1, VALUES),
        seed_digest(replace(one, case="l"), 1, VALUES),
        seed_digest(one, 1, VALUES | {"ekf/zero": 0.0}),
        seed_digest(one, 1, {name.replace("zero", "nought"): value for name, value in VALUES.items()}),
        seed_digest(one, 1, VALUES | {"ekf/max_error": math.nextafter(1.0, 2.0)}),
        seed_digest(one, 1, {name: value for name, value in VALUES.items() if name != "ekf/none"}),
    ]
    assert len({seed_digest(one, 1, VALUES), *others}) == 8


def test_provenance_lists_digests_and_what_was_damaged(tmp_path):
    one = work(tmp_path)
    for seed in one.seeds:
        write_seed(one, seed, {"a/b": float(seed)})
    first = one.provenance()
    assert first["digests"] == {str(seed): seed_digest(one, seed, {"a/b": seed}) for seed in one.seeds}
    assert first["damaged"] == {"count": 0, "seeds": []}
    write_seed(one, 2, {"a/b": 2.5})
    second = one.provenance()
    assert first["digest"] != second["digest"] and first["digests"]["1"] == second["digests"]["1"]
    (one.folder / "3.json").write_text("{")
    set_aside(one, take_stock(one).damaged)
    set_aside(one, [3])
    assert take_stock(one).absent == (3,)
    write_seed(one, 3, {"a/b": 3.0})
    sweep_seeds(one)
    third = one.provenance()
    assert third["damaged"] == {"count": 1, "seeds": [3]} and third["digest"] == second["digest"]


def test_what_is_computed_again_is_listed_by_seed(tmp_path):
    one = work(tmp_path, *range(1, 13))
    for seed in one.seeds:
        write_seed(one, seed, VALUES if seed != 12 else {"a/b": 1.0})
    (one.folder / "11.json").write_text("{")
    damaged, unlike = again_words(take_stock(one))
    assert damaged.endswith("1 seed (11)") and unlike.endswith("1 seed (12)")
    for seed in range(1, 10):
        (one.folder / f"{seed}.json").write_text("")
    assert again_words(take_stock(one))[0].endswith("10 seeds (1, 2, 3, 4, 5, 6, 7, 8, ...)")


class Pool(WorkerPool):
    """Computes at once, in this process, what the test says."""

    def __init__(self, trial: Callable[[int], dict[str, float]]) -> None:
        super().__init__()
        self.trial, self.asked = trial, list[int]()
        self._over: list[SeedResult] = []

    def places(self, room: int) -> int:
        return 1

    def submit(self, work: SeedWork, seed: int, timeout_s: float = float("inf")) -> None:
        self.asked.append(seed)
        write_seed(work, seed, self.trial(seed))
        self._over.append(SeedResult(work.study, seed))

    def collect(self, wait_s: float = 0.0) -> list[SeedResult]:
        over, self._over = self._over, []
        return over


def settled(
    one: SeedWork, trial: Callable[[int], dict[str, float]]
) -> tuple[list[int], list[Any], list[str]]:
    """Seeds computed, failures and words of a run up to where its notebook would start."""
    told: list[str] = []

    def tell(name: str, event: str, what: Any) -> None:
        if event == "again":
            told.append(what)

    job = Job(one.study, "", "", "", "", seeds=one)
    pool = Pool(trial)
    waiting = _waiting(job)
    scheduler = _Scheduler([waiting], pool, 0, tell)
    for _ in range(20):
        if waiting.ready:
            waiting.start(tell)
            for words in waiting.check():
                tell(one.study, "again", words)
            if waiting.ready:
                break
        scheduler.hand_out_seeds()
        scheduler.collect_seeds()
    assert waiting.ready
    return pool.asked, waiting.failures, told


def test_a_seed_with_other_names_is_computed_again(tmp_path):
    one = work(tmp_path, 1, 2, 3, 4)
    for seed in (1, 2, 3):
        write_seed(one, seed, {"a/b": 1.0} if seed != 1 else {"a/b": 1.0, "a/c": 2.0})
    asked, failures, told = settled(one, lambda seed: {"a/b": 1.0})
    assert asked == [1, 4] and failures == [] and len(told) == 1 and "other names" in told[0]
    assert take_stock(one).missing == ()


def test_kept_numbers_that_fresh_ones_outvote_are_computed_again(tmp_path):
    one = work(tmp_path, 1, 2)
    write_seed(one, 1, {"a/c": 1.0})
    asked, failures, told = settled(one, lambda seed: {"a/b": 1.0})
    assert asked == [2, 1] and failures == [] and told[0].endswith("1 seed (1)")


def test_a_trial_that_gives_other_names_for_a_seed_is_an_error(tmp_path):
    def trial(seed: int) -> dict[str, float]:
        return {"a/b": 1.0} if seed != 2 else {f"a/{letter}": 1.0 for letter in "cdef"}

    one = work(tmp_path, 1, 2, 3)
    for seed in one.seeds:
        write_seed(one, seed, trial(seed))
    asked, failures, _ = settled(one, trial)
    assert asked == [2], "each is computed again once"
    ((seed, failure),) = failures
    assert seed == 2
    for part in ("seed 1", "'a/b'", "'a/c'", "'a/d'", "2 more"):
        assert part in failure.reason


def test_a_damaged_seed_is_computed_again_and_said(tmp_path):
    one = work(tmp_path, 1, 2)
    for seed in one.seeds:
        write_seed(one, seed, VALUES)
    (one.folder / "2.json").write_text("{}")
    asked, failures, told = settled(one, lambda seed: VALUES)
    assert asked == [2] and failures == [] and len(told) == 1
    assert one.provenance()["damaged"]["seeds"] == [2]


def test_what_does_not_read_back_after_it_was_written_is_an_error(tmp_path):
    one = work(tmp_path, 1, 2)
    write_seed(one, 1, VALUES)
    (one.folder / "2.json").write_text("{}")
    ((seed, reason),) = faults(one, {1, 2})
    assert seed == 2 and "read back" in reason


@pytest.mark.parametrize("drawn", [1, 3, 9])
def test_the_flight_that_is_drawn_is_one_of_as_many_as_are_asked_for(drawn):
    seeds = other_seeds(drawn, 4)
    assert len({drawn, *seeds}) == 4 and list(seeds) == sorted(seeds)
