"""The way in: what ``make`` promises, tried with a made-up Python so that nothing is downloaded.

The stand-in answers the few questions that ``tools/environment.sh`` puts to a Python, notes every
installation in ``calls``, and fails in the way that ``FAULT`` names. That the real ones install is shown by
the other tests running.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from wildlab import paths

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")

STAND_IN = """\
#!/bin/sh
case "$*" in
*'%d.%d.%d'*) echo "${FAKE_VERSION:-3.11.7}" ;;
*'version_info < (3, 11)'*) case ${FAKE_VERSION:-3.11.7} in 3.10.*) exit 1 ;; esac ;;
*'import venv, ensurepip'*) [ "$FAULT" != no-venv ] ;;
'-m venv .venv') mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
'-m pip --version') [ "$FAULT" != no-pip ] ;;
'-m pip install'*)
    echo "$*" >>calls
    echo 'Collecting affine==3.0.1'
    for='a version that satisfies the requirement'
    case $FAULT in
    no-network) echo "WARNING: Retrying after NewConnectionError"; exit 1 ;;
    no-answer) echo "ERROR: Could not find $for affine==3.0.1 (from versions: none)"; exit 1 ;;
    no-wheel) echo "ERROR: Could not find $for affine==3.0.1 (from versions: 2.0)"
        echo "ERROR: No matching distribution found for affine==3.0.1"; exit 1 ;;
    wrong-hash) echo "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE."; exit 1 ;;
    full-disk) echo "ERROR: Could not install packages: [Errno 28] No space left on device"; exit 1 ;;
    other) echo "ERROR: something else"; exit 1 ;;
    hang) sleep 30 ;;
    esac
    echo 'Installing collected packages: affine' ;;
--version) echo Python "${FAKE_VERSION:-3.11.7}" ;;
esac
"""

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def environment_for(checkout: Path, **more: str) -> dict[str, str]:
    """What a user's shell would hold: nothing of a make, a pytest or a CI that runs these tests."""
    own = ("MAKEFLAGS", "MAKELEVEL", "MFLAGS", "PYTHON", "FAULT", "FAKE_VERSION", "CI")
    kept = {name: value for name, value in os.environ.items() if name not in own}
    return kept | {"PATH": f"{checkout.parent / 'bin'}{os.pathsep}{os.environ['PATH']}"} | more


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with a blank in its name, and the stand-in as the first python3 on the path."""
    folder = tmp_path / "check out"
    (folder / "tools").mkdir(parents=True)
    shutil.copy(paths.ROOT / "Makefile", folder)
    shutil.copy(paths.ROOT / "tools" / "environment.sh", folder / "tools")
    (folder / "environment.lock").write_text("affine==3.0.1\n", encoding="utf-8")
    (folder / "pyproject.toml").write_text("[project]\n", encoding="utf-8")
    python = tmp_path / "bin" / "python3"
    python.parent.mkdir()
    python.write_text(STAND_IN, encoding="utf-8")
    python.chmod(0o755)
    return folder


@pytest.fixture
def make(checkout: Path) -> Run:
    def run(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["make", "--no-print-directory", *arguments],
            cwd=checkout,
            env=environment_for(checkout, **more),
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    return run


def sentence_of(done: subprocess.CompletedProcess[str]) -> str:
    """The one line that a failure leaves, beside make's own."""
    lines = [line for line in done.stderr.splitlines() if line and not line.startswith("make")]
    assert done.returncode == 2, done
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    return lines[0]


def calls(checkout: Path) -> list[str]:
    file = checkout / "calls"
    return file.read_text(encoding="utf-8").splitlines() if file.exists() else []


def test_help_comes_first_and_lists_every_target(make):
    done = make()
    text = (paths.ROOT / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", text, re.MULTILINE)
    assert phony is not None
    listed = re.findall(r"^  make (\S+)", done.stdout, re.MULTILINE)
    assert done.returncode == 0
    assert listed == phony.group(1).split()


def test_environment_is_made_once(make, checkout):
    done = make("environment")
    assert done.returncode == 0, done.stderr
    packages, own = calls(checkout)
    for wanted in ("--require-hashes", "--no-deps", "--only-binary :all:", "-r environment.lock"):
        assert wanted in packages
    assert "--editable ." in own
    again = make("environment")
    assert (again.returncode, again.stdout, again.stderr) == (0, "", "")
    assert len(calls(checkout)) == 2


def test_changed_lock_updates_and_changed_project_reinstalls_wildlab_alone(make, checkout):
    make("environment")
    (checkout / "pyproject.toml").write_text("[project]\nname = 'x'\n", encoding="utf-8")
    make("environment")
    assert ["-r environment.lock" in call for call in calls(checkout)] == [True, False, False]
    (checkout / "environment.lock").write_text("affine==3.0.2\n", encoding="utf-8")
    marker = checkout / ".venv" / "kept"
    marker.touch()
    make("environment")
    assert ["-r environment.lock" in call for call in calls(checkout)] == [True, False, False, True, False]
    assert marker.exists()
    assert make("environment").stdout == ""


def test_failed_installation_is_not_taken_for_a_whole_one(make, checkout):
    sentence_of(make("environment", FAULT="no-network"))
    assert not (checkout / ".venv" / "installed").exists()
    make("environment")
    assert (checkout / ".venv" / "installed" / "environment.lock").exists()
    # Nor is one whose update failed.
    (checkout / "environment.lock").write_text("affine==3.0.2\n", encoding="utf-8")
    sentence_of(make("environment", FAULT="wrong-hash"))
    assert not (checkout / ".venv" / "installed").exists()


def test_interrupted_installation_is_not_taken_for_a_whole_one(make, checkout):
    running = subprocess.Popen(
        ["make", "environment"],
        cwd=checkout,
        env=environment_for(checkout, FAULT="hang"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        stdin=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        deadline = time.monotonic() + 20
        while not calls(checkout) and time.monotonic() < deadline:
            time.sleep(0.02)
        # Meanwhile a second make must not pull the environment from under the first.
        sentence_of(make("environment"))
    finally:
        os.killpg(running.pid, signal.SIGTERM)
        assert running.wait(timeout=20) != 0
    assert not (checkout / ".venv" / "installed").exists()
    assert make("environment").returncode == 0
    assert (checkout / ".venv" / "installed").is_dir()


def test_moved_checkout_gets_a_new_environment(make, checkout):
    make("environment")
    moved = checkout.rename(checkout.with_name("moved"))
    checkout.symlink_to(moved)
    assert "Replacing .venv" in make("environment").stdout


@pytest.mark.parametrize(
    ("arguments", "more", "about"),
    [
        (["PYTHON=python3"], {"FAKE_VERSION": "3.10.13"}, "3.10.13"),
        (["PYTHON=python9.9"], {}, "python9.9"),
        ([], {"FAULT": "no-venv"}, "venv"),
        ([], {"FAULT": "no-network"}, "network"),
        ([], {"FAULT": "no-wheel"}, "affine==3.0.1 for Python 3.11.7"),
        ([], {"FAULT": "wrong-hash"}, "hash"),
        ([], {"FAULT": "other"}, "ERROR: something else"),
    ],
)
def test_what_goes_wrong_is_one_sentence(make, arguments, more, about):
    assert about in sentence_of(make("environment", *arguments, **more))


def test_no_python_new_enough(make, checkout):
    """Every Python on the path is too old, or there is none."""
    tools = checkout.parent / "tools"
    tools.mkdir()
    for name in ("sh", "make", "dirname", "awk", "cat", "cmp", "cksum", "cut", "df", "id", "mkdir", "rm"):
        (tools / name).symlink_to(shutil.which(name) or name)
    assert "no python3" in sentence_of(make("environment", PATH=str(tools)))
    shutil.copy(checkout.parent / "bin" / "python3", tools)
    assert "3.10.13" in sentence_of(make("environment", PATH=str(tools), FAKE_VERSION="3.10.13"))


def test_lock_names_no_index_and_hashes_everything():
    text = paths.LOCK.read_text(encoding="utf-8")
    assert not re.search(r"https?:|file:|--(?:extra-)?index-url|--find-links|@ ", text)
    blocks = re.split(r"^(?=[A-Za-z0-9])", text, flags=re.MULTILINE)[1:]
    assert len(blocks) > 100
    for block in blocks:
        assert re.match(r"[A-Za-z0-9._-]+==\S+", block), block[:80]
        assert "--hash=sha256:" in block, block[:80]


def commands_in_readme() -> str:
    """What README and docs show as something to type: between backticks, or indented."""
    files = [paths.ROOT / "README.md", *(paths.ROOT / "docs").glob("*.md")]
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    return "\n".join(re.findall(r"`[^`\n]+`|^    .*$", text, re.MULTILINE))


def test_readme_names_only_targets_that_exist():
    makefile = (paths.ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"\bmake ([a-z][a-z-]*)", commands_in_readme()))
    assert {"reports", "test"} <= named
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_table_of_commands_lists_every_one():
    from wildlab.cli import wildlab

    text = (paths.ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `wildlab ([a-z]+)", text, re.MULTILINE)) == set(wildlab.commands)
