"""The store of seeds: every float as it was, nothing taken for something else, and each error's sentence."""

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

from wildlab.errors import RunFailed
from wildlab.paths import NOTEBOOKS
from wildlab.runner import open_study
from wildlab.runner import seeds as fingerprint
from wildlab.runner.open_study import trials_table
from wildlab.runner.scheduling import _Study
from wildlab.runner.seeds import (
    SeedWork,
    answer,
    make_work,
    missing_seeds,
    other_seeds,
    read_seed,
    seed_digest,
    sweep_seeds,
    write_seed,
)
from wildlab.studies import protocol

PARAMETERS = {"twin": "static-antenna", "not its own": 3}


def work(folder: Path, count: int = 4) -> SeedWork:
    return make_work(folder, "study", "static-point", 2, count, PARAMETERS)


@given(value=st.floats(allow_nan=False))
def test_every_float_is_read_back_as_it_was(tmp_path_factory, value):
    one = SeedWork(tmp_path_factory.getbasetemp() / "floats", "s", "n", {}, "c", "k", (1,))
    write_seed(one, 1, {"a/b": value, "a/nan": math.nan})
    read = read_seed(one, 1)
    assert read is not None and list(read) == ["a/b", "a/nan"] and math.isnan(read["a/nan"])
    assert read["a/b"].hex() == value.hex()
    json.loads((one.folder / "1.json").read_text(), parse_constant=lambda word: pytest.fail(word))


@given(drawn=st.integers(0, 40), count=st.integers(1, 40))
def test_seeds_besides_the_one_drawn(drawn, count):
    seeds = other_seeds(drawn, count)
    assert len({drawn, *seeds}) == count and list(seeds) == sorted(seeds)
    assert not count > drawn > 0 or set(seeds) | {drawn} == set(range(1, count + 1))


def test_the_key_follows_what_the_numbers_depend_on(tmp_path):
    first = work(tmp_path)
    assert first.parameters == {"twin": "static-antenna"}
    trial_key = fingerprint.trial_key
    assert work(tmp_path, 9).key == first.key == trial_key(first.case, first.parameters, first.code)
    others = {
        trial_key(first.case, first.parameters | {"twin": "slow-vessel"}, first.code),
        trial_key(first.case, first.parameters, "other code"),
        trial_key("slow-vessel", first.parameters, first.code),
    }
    assert len(others | {first.key}) == 4


def test_the_code_key_follows_code_twins_and_versions(tmp_path, monkeypatch):
    files = (
        "wildlab/tracking/a.py",
        "wildlab/flight/readers/b.py",
        "data/twins/parts/c.toml",
        "wildlab/studies/schmidt.py",
        "wildlab/cli.py",
        "wildlab/studies/page.py",
    )
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
    monkeypatch.setattr(fingerprint, "PACKAGE", tmp_path / "wildlab")
    monkeypatch.setattr(fingerprint, "DATA", tmp_path / "data")
    keys = [fingerprint.code_key(), fingerprint.code_key()]
    for name in files:
        (tmp_path / name).write_text("2")
        keys.append(fingerprint.code_key())
    monkeypatch.setattr(fingerprint, "version", lambda package: "0")
    keys.append(fingerprint.code_key())
    assert keys[0] == keys[1] and keys[5] == keys[6] == keys[7], "neither time nor what stands above moves it"
    assert len(set(keys)) == 6


VALUES = {
    "schmidt/nees_inside": 0.9333333333333333,
    "schmidt/median_nees": 3.25e-7,
    "ekf/max_error": 1.0,
    "ekf/none": math.nan,
    "ekf/beyond": -math.inf,
    "ekf/zero": -0.0,
}


def kept_work(folder: Path, *seeds: int, key: str = "k") -> SeedWork:
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
def test_a_turned_bit_is_never_read(tmp_path_factory, values, place, bit):
    one = kept_work(tmp_path_factory.getbasetemp() / "bits", 1)
    write_seed(one, 1, values)
    turned = bytearray((one.folder / "1.json").read_bytes())
    turned[place % len(turned)] ^= 1 << bit
    (one.folder / "1.json").write_bytes(bytes(turned))
    assert read_seed(one, 1) is None


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: text[: len(text) // 2],
        lambda text: "[" * 5000,
        lambda text: text.replace("0.9333333333333333", "0.8333333333333333"),
        lambda text: text.replace('"nan"', "NaN"),
        rewrite(lambda content: content["values"].pop("ekf/zero")),
        rewrite(lambda content: content["values"].update({"ekf/more": 1.0})),
        rewrite(lambda content: content["values"].update({"ekf/zero": 0.0})),
        rewrite(lambda content: content.update(seed=2)),
    ],
)
def test_whatever_was_done_to_a_file_it_is_not_read(tmp_path, damage):
    one = kept_work(tmp_path)
    write_seed(one, 1, VALUES)
    path = one.folder / "1.json"
    assert missing_seeds(one) == [2, 3]
    text = damage(path.read_text())
    assert text != path.read_text()
    path.write_text(text)
    assert read_seed(one, 1) is None and missing_seeds(one) == [1, 2, 3]


def test_a_file_of_another_key_study_or_seed_is_not_read(tmp_path):
    one, other = kept_work(tmp_path), kept_work(tmp_path, key="another")
    for its in (one, other):
        for seed in its.seeds:
            write_seed(its, seed, VALUES)
    shutil.copy(other.folder / "1.json", one.folder / "1.json")
    shutil.copy(one.folder / "3.json", one.folder / "2.json")
    assert missing_seeds(one) == [1, 2] and missing_seeds(replace(one, case="another")) == [1, 2, 3]


def test_a_digest_is_of_all_that_is_said_and_of_nothing_else(tmp_path):
    one = kept_work(tmp_path, 1)
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


def test_provenance_lists_digests(tmp_path):
    one = kept_work(tmp_path)
    for seed in one.seeds:
        write_seed(one, seed, {"a/b": float(seed)})
    first = one.provenance()
    assert first["digests"] == {str(seed): seed_digest(one, seed, {"a/b": seed}) for seed in one.seeds}
    write_seed(one, 2, {"a/b": 2.5})
    second = one.provenance()
    assert first["digest"] != second["digest"] and first["digests"]["1"] == second["digests"]["1"]
    (one.folder / "3.json").write_text("{")
    assert missing_seeds(one) == [3]
    write_seed(one, 3, {"a/b": 3.0})
    assert one.provenance()["digest"] == second["digest"]


def test_a_run_computes_damaged_seeds_again(tmp_path):
    one = kept_work(tmp_path)
    for seed in (1, 2):
        write_seed(one, seed, VALUES)
    (one.folder / "2.json").write_text("{}")
    waiting, told = _Study(one.study, one), list[tuple[str, object]]()
    waiting.start(lambda name, event, what: told.append((event, what)))
    assert list(waiting.seeds) == [2, 3] and not waiting.ready
    assert dict(told)["seeds"] == (2, 3)


@pytest.mark.parametrize(
    ("kept", "sentence"),
    [
        ({"a/b": 1.0}, "Seed 3 has numbers of other names than seed 1: 'a/b', 'a/c'"),
        (None, "seed 3 do not read back"),
    ],
)
def test_numbers_that_do_not_go_together_are_an_error(tmp_path, monkeypatch, kept, sentence):
    one = work(tmp_path, 3)
    write_seed(one, 1, {"a/c": 1.0})

    def compute(works: list[SeedWork], parallel: int, tell: Any) -> dict[str, str]:
        assert missing_seeds(works[0]) == [3]
        if kept is not None:
            write_seed(works[0], 3, kept)
        return {}

    monkeypatch.setattr(open_study, "compute_seeds", compute)
    with pytest.raises(RunFailed, match=sentence):
        trials_table(
            "static-point", 3, study="study", seed=2, drawn={}, out=str(tmp_path / "study"),
            twin="static-antenna",
        )  # fmt: skip


def test_sweeping_keeps_what_is_in_use(tmp_path):
    new, old = work(tmp_path), replace(work(tmp_path), key="old")
    for one in (new, old, replace(new, study="another")):
        write_seed(one, 1, {"a/b": 1.0})
    (new.folder / ".3.json.half").write_text("{")
    sweep_seeds(new)
    left = {
        path.relative_to(tmp_path / ".seeds").as_posix() for path in tmp_path.rglob("*") if path.is_file()
    }
    assert left == {f"study/{new.key}/1.json", f"another/{new.key}/1.json"}


def test_the_table_has_the_drawn_flight_first(tmp_path):
    one = work(tmp_path)
    for seed in one.seeds:
        write_seed(one, seed, {"a/b": seed / 3})
    table = trials_table(
        "static-point", 4, study="study", seed=2, drawn={("a", "b"): 9.0, ("a", "c"): 1.0},
        out=str(tmp_path / ".study.part"), twin="static-antenna",
    )  # fmt: skip
    assert list(table.index) == [2, 1, 3, 4] and list(table["a", "b"]) == [9.0, 1 / 3, 1.0, 4 / 3]
    assert list(table["a", "c"].isna()) == [False, True, True, True]


@pytest.mark.slow
def test_a_notebook_opened_by_hand_computes_what_is_missing(tmp_path, capsys):
    def table(seeds: int, twin: str) -> Any:
        return trials_table(
            "static-point", seeds, study="study", seed=2, drawn={}, out=str(tmp_path / "study"), twin=twin,
        )  # fmt: skip

    with pytest.raises(RunFailed, match=r"Seed 1 failed.*twin"):
        table(3, "no-such-twin")
    capsys.readouterr()
    assert table(2, "static-antenna")["pixhawk-autopilot", "mae"].iloc[1] > 0
    assert "study: 1 of 1 seeds" in capsys.readouterr().out
    fresh = protocol.run_trial("static-point", 1, {"twin": "static-antenna"})
    assert read_seed(replace(work(tmp_path), seeds=(1,)), 1) == fresh


def test_other_code_is_not_mixed_in():
    kind, content = answer("static-point", 1, {}, "another")
    assert kind == "failed" and "are not those that the run began with" in content[0]


TEXTS = ("glossary.toml", "published/a.toml", "studies/a.toml", "messages/en/a.toml")


@pytest.mark.parametrize("changed", TEXTS)
def test_a_page_is_made_again_where_what_it_says_has_changed(changed, tmp_path, monkeypatch):
    files = [tmp_path / one for one in TEXTS]
    for one in files:
        one.parent.mkdir(parents=True, exist_ok=True)
        one.write_text("")
    monkeypatch.setattr(fingerprint, "DATA", tmp_path)
    before = fingerprint.page_key(NOTEBOOKS / "schmidt.ipynb", {}, "")
    (tmp_path / changed).write_text("a = 1")
    assert fingerprint.page_key(NOTEBOOKS / "schmidt.ipynb", {}, "") != before
