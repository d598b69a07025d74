"""The command line: help with examples, sentences and exit codes, and no traceback unless asked for."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import time
from typing import Any

import click
import numpy as np
import pytest

from tests.analysis.survey_twin import Survey, simulate
from tests.commands import call, refuse
from tests.flight.conftest import make_flight
from wildlab import cli
from wildlab.errors import RunFailed, WildlabError, system_error
from wildlab.flight.store import save_flight
from wildlab.runner.run import Outcome

__all__ = ["make_flight"]


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Any:
    """``failing(error)`` makes `wildlab list` raise it."""

    def install(error: BaseException) -> None:
        def fail(*_: Any, **__: Any) -> None:
            raise error

        monkeypatch.setattr("wildlab.runner.catalogue.load_studies", fail)

    return install


@pytest.mark.parametrize("name", cli.wildlab.commands)
def test_every_command_shows_an_example(name):
    code, out, _ = call(name, "--help")
    assert code == 0 and f"wildlab {name}" in out.split("Example")[1]


@pytest.mark.parametrize(
    ("arguments", "heavy"),
    [
        (["--help"], {"numpy", "pandas", "matplotlib", "papermill", "rich", "pydantic"}),
        (["list", "--out", "none"], {"pandas", "scipy", "matplotlib", "papermill", "rich", "platformdirs"}),
    ],
)
def test_what_only_tells_imports_no_heavy_package(arguments, heavy, tmp_path):
    program = (
        "import sys\nfrom wildlab.cli import main\n"
        f"try:\n    main({arguments!r})\nexcept SystemExit:\n    pass\n"
        f"assert not (found := {heavy!r} & set(sys.modules)), found"
    )
    began = time.monotonic()
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, cwd=tmp_path)
    # Half a second is the promise; a machine that runs other tests beside it may take longer to start Python.
    assert time.monotonic() - began < 3


def test_list_as_a_table_and_as_json(tmp_path):
    code, out, _ = call("list", "--out", str(tmp_path))
    assert code == 0 and "consistency-bounds" in out
    code, out, _ = call("list", "--json", "--out", str(tmp_path))
    studies = {entry["study"]: entry for entry in json.loads(out)}
    assert code == 0 and studies["consistency-bounds"]["state"] == "not run"
    first = studies["consistency-bounds"]["published"][0]
    assert (first["published"], first["here"], first["closeness"]) == (0.48, None, "not reproduced yet")


@pytest.mark.parametrize(
    ("arguments", "about"),
    [
        (["rnu"], "'run'"),
        (["run", "sensitivty"], "'sensitivity'"),
        (["run", "--jobs", "0", "--all"], "--jobs"),
        (["check"], "FLIGHT"),
        (["simulate", "static-antenna"], "--out"),
    ],
)
def test_wrong_use_has_exit_code_2(arguments, about):
    assert about in refuse(*arguments)


def test_a_folder_that_is_no_flight_is_refused(tmp_path):
    for command in ("check", "evaluate"):
        assert "nothing" in refuse(command, tmp_path / "nothing")


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (WildlabError("it is raining", "wait", file="sky.toml"), 2, "sky.toml: it is raining. Wait."),
        (RunFailed("it did not work", "try again"), 1, "Try again."),
        (KeyError("x"), 1, "WILDLAB_DEBUG=1"),
        (KeyboardInterrupt(), 130, "kept"),
        (click.Abort(), 130, "kept"),
    ],
)
def test_errors_become_sentences(monkeypatch, failing, error, code, sentence):
    monkeypatch.delenv("WILDLAB_DEBUG", raising=False)
    failing(error)
    found, _, err = call("list")
    assert found == code and sentence in err and "Traceback" not in err


def test_debugging_shows_where(monkeypatch, failing):
    monkeypatch.setenv("WILDLAB_DEBUG", "1")
    failing(KeyError("x"))
    with pytest.raises(KeyError):
        cli.main(["list"])


def test_run_prints_the_ledger_and_fails_if_one_failed(monkeypatch, tmp_path):
    given: dict[str, Any] = {}

    def run_studies(names: Any, **options: Any) -> list[Outcome]:
        given.update(options, names=names)
        return [Outcome("a", "done", 1.0), Outcome("b", "failed", 1.0, "why"), Outcome("c", "skipped", 0.0)]

    monkeypatch.setattr("wildlab.runner.run.run_studies", run_studies)
    code, out, err = call("run", "a", "b", "--seed", "7", "--timeout", "0.5", "--out", str(tmp_path))
    assert code == 1 and out.strip() == str(tmp_path / "index.html") and "1 of 3" in err
    assert (given["names"], given["seed"], given["timeout_s"]) == (("a", "b"), 7, 30.0)


def test_fetch_without_a_name_lists_the_data_sets():
    code, out, _ = call("fetch", "--json")
    assert code == 0 and {"dataset", "fetched", "title"} <= set(json.loads(out)[0])
    assert "nonsense" in refuse("fetch", "nonsense")


def test_check_tells_what_a_flight_can_be_used_for(tmp_path, make_flight):
    save_flight(make_flight(), tmp_path / "flight")
    code, out, _ = call("check", "--json", str(tmp_path / "flight"))
    usable = {use["purpose"]: use["usable"] for use in json.loads(out)["usable_for"]}
    assert code == 0 and usable["georeferencing accuracy"] is True and usable["navigation"] is False
    code, out, _ = call("check", str(tmp_path / "flight"))
    assert code == 0 and ": yes" in out


def test_check_does_not_call_a_flight_usable_that_contradicts_itself(tmp_path):
    flight = simulate(Survey(images=8))
    nav = flight.nav["logged"]
    for axis, sign in (("north", -1.0), ("east", 1.0), ("down", 1.0)):
        nav[f"v_{axis}_m_s"] = sign * np.gradient(nav[f"{axis}_m"], nav["time_s"])
    save_flight(flight, tmp_path / "flight")
    code, out, _ = call("check", str(tmp_path / "flight"))
    assert code == 2 and ": yes" not in out
    # What is computed from it all the same says so, beside the file.
    code, out, err = call("georeference", str(tmp_path / "flight"), "--out", str(tmp_path / "points.csv"))
    assert code == 0 and "problem: " in err and "problem: " not in out


@pytest.mark.parametrize(
    ("number", "fix"),
    [
        (errno.ENOSPC, "space"),
        (errno.EACCES, "permissions"),
        (errno.ENAMETOOLONG, "shorter"),
    ],
)
def test_what_the_system_says_is_a_sentence_with_the_file(failing, tmp_path, number, fix):
    failing(OSError(number, os.strerror(number), str(tmp_path / "not" / "there")))
    code, _, err = call("list")
    assert code == 2 and err.count("\n") == 1
    assert err.startswith(f"wildlab: {tmp_path}/not/there: ") and os.strerror(number) in err and fix in err


def test_a_full_disk_is_named_by_where_it_is_mounted(tmp_path):
    place = tmp_path
    while not os.path.ismount(place):
        place = place.parent
    said = str(system_error(OSError(errno.ENOSPC, "full"), tmp_path / "deep" / "file"))
    assert said.endswith(f" {place}.")
