"""The store of seeds: every float as it was, nothing taken for something else, and each error's sentence."""

from __future__ import annotations

import builtins
import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from wildlab.errors import RunFailed, WildlabError
from wildlab.paths import NOTEBOOKS
from wildlab.runner import open_study
from wildlab.runner import seeds as fingerprint
from wildlab.runner.catalogue import load_studies
from wildlab.runner.open_study import trials_table
from wildlab.runner.processes import cluster
from wildlab.runner.processes.job import Job
from wildlab.runner.processes.progress import shown
from wildlab.runner.processes.scheduling import Outcome, _waiting
from wildlab.runner.processes.worker_pool import WorkerPool, answer
from wildlab.runner.run import _notes
from wildlab.runner.seeds import (
    SeedWork,
    failed_seeds,
    make_work,
    missing_seeds,
    other_seeds,
    read_seed,
    seed_digest,
    set_aside,
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
        "wildlab/studies/schmidt/trial.py",
        "wildlab/cli.py",
        "wildlab/studies/schmidt/text.py",
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
    one = kept_work(tmp_path)
    write_seed(one, 1, VALUES)
    path = one.folder / "1.json"
    assert missing_seeds(one) == [2, 3]
    text = damage(path.read_text())
    assert text != path.read_text()
    path.write_text(text)
    assert read_seed(one, 1) is None and missing_seeds(one) == [1, 2, 3]
    assert set_aside(one) == [1]


def test_a_file_of_another_key_study_or_seed_is_not_read(tmp_path):
    one, other = kept_work(tmp_path), kept_work(tmp_path, key="another")
    for its in (one, other):
        for seed in its.seeds:
            write_seed(its, seed, VALUES)
    shutil.copy(other.folder / "1.json", one.folder / "1.json")
    shutil.copy(one.folder / "3.json", one.folder / "2.json")
    assert missing_seeds(one) == [1, 2] and missing_seeds(replace(one, case="another")) == [1, 2, 3]


def test_a_file_without_a_digest_counts_as_absent(tmp_path):
    one = kept_work(tmp_path, 1)
    one.folder.mkdir(parents=True)
    (one.folder / "1.json").write_text('{"case": "case", "seed": 1, "values": {"a/b": 1.0}}')
    assert missing_seeds(one) == [1] and set_aside(one) == []


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


def test_provenance_lists_digests_and_what_was_damaged(tmp_path):
    one = kept_work(tmp_path)
    for seed in one.seeds:
        write_seed(one, seed, {"a/b": float(seed)})
    first = one.provenance()
    assert first["digests"] == {str(seed): seed_digest(one, seed, {"a/b": seed}) for seed in one.seeds}
    assert first["damaged"] == {"count": 0, "seeds": []}
    write_seed(one, 2, {"a/b": 2.5})
    second = one.provenance()
    assert first["digest"] != second["digest"] and first["digests"]["1"] == second["digests"]["1"]
    (one.folder / "3.json").write_text("{")
    assert set_aside(one) == [3] and set_aside(one) == [] and missing_seeds(one) == [3]
    write_seed(one, 3, {"a/b": 3.0})
    sweep_seeds(one)
    third = one.provenance()
    assert third["damaged"] == {"count": 1, "seeds": [3]} and third["digest"] == second["digest"]


def test_a_run_computes_damaged_seeds_again_and_says_so(tmp_path):
    one = kept_work(tmp_path)
    for seed in (1, 2):
        write_seed(one, seed, VALUES)
    (one.folder / "2.json").write_text("{}")
    waiting, told = _waiting(Job(one.study, "", "", "", "", seeds=one)), list[tuple[str, object]]()
    waiting.start(lambda name, event, what: told.append((event, what)))
    assert list(waiting.seeds) == [2, 3] and not waiting.ready
    assert dict(told)["seeds"] == (2, 3) and str(dict(told)["again"]).endswith("1 seed (2)")


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

    def compute(work: SeedWork, missing: list[int]) -> None:
        assert missing == [3]
        if kept is not None:
            write_seed(work, 3, kept)

    monkeypatch.setattr(open_study, "_compute", compute)
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

    with pytest.raises(RunFailed, match=r"Seed 1 failed \(so did 1 more: 3\).*twin"):
        table(3, "no-such-twin")
    capsys.readouterr()
    assert table(2, "static-antenna")["pixhawk-autopilot", "mae"].iloc[1] > 0
    assert "study: 1 of 1 seeds" in capsys.readouterr().out
    fresh = protocol.run_trial("static-point", 1, {"twin": "static-antenna"})
    assert read_seed(replace(work(tmp_path), seeds=(1,)), 1) == fresh


def test_other_code_is_not_mixed_in():
    kind, content = answer("static-point", 1, {}, "another")
    assert kind == "failed" and "are not those that the run began with" in content[0]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: protocol.find_case("static-pont"), "there is no case 'static-pont'"),
        (
            lambda: make_work(Path(), "s", "slow-vessel", 1, 3, {"twin": "x"}),
            "needs the parameter 'first'",
        ),
        (lambda: make_work(Path(), "s", "static-point", 1, 3, {"twin": None}), "Name the study's twin"),
        (lambda: cluster.Cluster("127.0.0.1:8786"), "is no address of a scheduler.*tcp://127.0.0.1:8786"),
        (lambda: cluster.Cluster("tcp://127.0.0.1:1; ls"), "is no address of a scheduler"),
    ],
)
def test_wrong_use_is_a_sentence(call, sentence):
    with pytest.raises(WildlabError, match=sentence):
        call()


@pytest.mark.parametrize("given", [{}, {("a/b", "c"): 1.0}])
def test_a_function_that_gives_no_numbers_is_refused(monkeypatch, given):
    empty = protocol.Study("static-point", lambda seed: given)
    monkeypatch.setattr("wildlab.studies.static_point.STUDY", empty)
    with pytest.raises(WildlabError, match="Give numbers by"):
        protocol.run_trial("static-point", 1, {})


def test_no_scheduler_at_the_address(monkeypatch):
    pytest.importorskip("distributed", reason="needs dask.distributed (the extra `cluster`)")
    monkeypatch.setattr(cluster, "PATIENCE_S", 0.5)
    with pytest.raises(WildlabError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9") as caught:
        cluster.Cluster("tcp://127.0.0.1:9")
    assert caught.value.exit_code == 2


def test_without_dask_a_sentence_says_how_to_get_it(monkeypatch):
    real = builtins.__import__

    def without(name: str, *more: Any) -> Any:
        if name == "distributed":
            raise ImportError(name)
        return real(name, *more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(WildlabError, match=r"not installed here.*pip install distributed.*make environment"):
        cluster.Cluster("tcp://127.0.0.1:8786")


def test_another_python_or_dask_on_the_cluster_is_refused():
    def about(python: str = "3.11.7", dask: str = "2026.8.0") -> dict[str, Any]:
        return {"host": {"python": f"{python}.final.0"}, "packages": {"distributed": dask}}

    same = {"client": about(), "scheduler": about("3.11.2"), "workers": {"tcp://b": about()}}
    cluster._check_versions(same, "tcp://a")
    with pytest.raises(WildlabError, match=r"tcp://b has Python 3\.12, and here it is 3\.11"):
        cluster._check_versions(same | {"workers": {"tcp://b": about("3.12.1")}}, "tcp://a")
    with pytest.raises(WildlabError, match=r"the scheduler has distributed 1\.0, and here it is 2026\.8\.0"):
        cluster._check_versions(same | {"scheduler": about(dask="1.0")}, "tcp://a")


def test_what_has_no_effect_is_said():
    studies = load_studies(NOTEBOOKS / "studies.toml")
    chosen = [studies["static-point"], studies["sensitivity"]]
    assert _notes(chosen, None, None) == [] == _notes(chosen[:1], 5, "tcp://a:1")
    seeds, scheduler = _notes(chosen, 5, "tcp://a:1")
    assert seeds.startswith("--seeds has no effect on sensitivity:")
    assert scheduler.startswith("--scheduler has no effect on sensitivity:")


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ('case = "nothing"\nseeds = 3', "there is no case 'nothing'; use one of: autoferry, "),
        ("seeds = 3\n[s.parameters]\nseeds = 4", "the number of seeds is given twice"),
    ],
)
def test_a_study_that_contradicts_itself_is_refused(tmp_path, entry, sentence):
    path = tmp_path / "studies.toml"
    path.write_text(f'[s]\ntitle = "S"\nnotebook = "s.ipynb"\n{entry}\n')
    with pytest.raises(WildlabError, match=sentence):
        load_studies(path)


def test_failures_in_words():
    assert failed_seeds([(7, "It rains.")]) == "seed 7 failed: It rains"
    assert failed_seeds([(7, "b."), (3, "a.")]) == "seed 3 failed (so did 1 more: 7): a"
    assert "so did 10 more: 1, 2, 3, 4, 5, 6, 7, 8, ...)" in failed_seeds([(k, "a.") for k in range(11)])


def test_an_idle_pool_has_no_processes():
    with WorkerPool() as pool:
        assert (pool.size, pool.pipes, pool.places(2), pool.collect()) == (0, [], 2, [])


def test_one_bar_counts_seeds_and_cells():
    text = StringIO()
    console = Console(file=text, force_terminal=True, width=160)
    with shown(console) as tell:
        tell("", "plan", 4 + 3)
        tell("one", "start", None)
        tell("one", "seeds", (4, 10))
        for done in (1, 2, 3, 4):
            tell("one", "seed", (done, 4))
        for cell in (0, 1, 2):
            tell("one", "cell", (cell, 3))
        tell("one", "stage", ("page",))
        tell("two", "start", None)
        tell("one", "end", Outcome("one", "done", 3.0))
    assert "7 of 7" in text.getvalue() and text.getvalue().count("done") == 1


@pytest.mark.parametrize("changed", ["glossary.toml", "published/a.toml", "messages/en/a.toml"])
def test_a_page_is_made_again_where_what_it_says_has_changed(changed, tmp_path, monkeypatch):
    files = [tmp_path / one for one in ("glossary.toml", "published/a.toml", "messages/en/a.toml")]
    for one in files:
        one.parent.mkdir(parents=True, exist_ok=True)
        one.write_text("")
    monkeypatch.setattr(fingerprint, "DATA", tmp_path)
    before = fingerprint.page_key(NOTEBOOKS / "schmidt.ipynb", {}, "")
    (tmp_path / changed).write_text("a = 1")
    assert fingerprint.page_key(NOTEBOOKS / "schmidt.ipynb", {}, "") != before
