"""wildlab installed from a wheel, in an environment of its own and far from the checkout.

The environment borrows the packages of the one that the tests run in, all but wildlab itself.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

from wildlab import paths
from wildlab.runner.seeds import code_key

pytestmark = pytest.mark.slow

#: What lies about in a working copy and is nobody's business, and a module left from an earlier build.
PLANTED = (
    "data/fetched/openathena/photos.toml",
    "notebooks/.ipynb_checkpoints/gating-checkpoint.ipynb",
    "notebooks/scratch.csv",
    "reports/mine/README.md",
    "tests/test_planted.py",
    "build/lib/wildlab/renamed_since.py",
)


class Installed(NamedTuple):
    wheel: Path
    packages: Path
    python: Path
    here: Path
    environment: dict[str, str]

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            cwd=self.here,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )

    def wildlab(self, *arguments: str) -> str:
        """Standard output of a command, which must end well."""
        done = self.run(str(self.python.parent / "wildlab"), *arguments)
        assert done.returncode == 0, f"{arguments}: {done.stdout}\n{done.stderr}"
        return done.stdout

    def files(self) -> set[str]:
        """What is installed, without the caches that Python and numba keep beside the code."""
        found = (path.relative_to(self.packages) for path in self.packages.rglob("*"))
        return {path.as_posix() for path in found if "__pycache__" not in path.parts}


def build_wheel(folder: Path) -> Path:
    """The wheel of a copy of this checkout, with things in it that must not travel."""
    copy = folder / "checkout"
    for name in ("wildlab", "notebooks", "data"):
        ignored = shutil.ignore_patterns("__pycache__", ".*", "fetched")
        shutil.copytree(paths.ROOT / name, copy / name, ignore=ignored)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE", "environment.lock"):
        shutil.copy(paths.ROOT / name, copy)
    for name in PLANTED:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text("planted", encoding="utf-8")
    options = ["--no-build-isolation", "--no-deps", "--no-index", "--quiet", "--wheel-dir", str(folder)]
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, str(copy)], check=True, timeout=300)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    folder = tmp_path_factory.mktemp("wheel")
    wheel = build_wheel(folder)
    prefix = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(prefix)], check=True, timeout=300)
    python = prefix / "bin" / "python"
    install = ["install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), *install], check=True, timeout=300)
    about = [str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(about, check=True, capture_output=True, text=True).stdout.strip())
    # Folders named in a .pth file are looked into last, and .pth files in them (the checkout's) not at all.
    others = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (packages / "others.pth").write_text("\n".join(sorted(others)), encoding="utf-8")
    # The templates of nbconvert are looked for in the environment, where its own wheel would have put them.
    (prefix / "share" / "jupyter").mkdir(parents=True)
    templates = Path(sys.prefix) / "share" / "jupyter" / "nbconvert"
    (prefix / "share" / "jupyter" / "nbconvert").symlink_to(templates)
    for name in ("home", "here"):
        (folder / name).mkdir()
    environment = {"PATH": os.environ["PATH"], "HOME": str(folder / "home"), "LANG": "C.UTF-8"}
    return Installed(wheel, packages, python, folder / "here", environment)


def shipped(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_what_is_in_the_wheel(installed):
    names = shipped(installed.wheel)
    resources = {name.removeprefix("wildlab/resources/") for name in names if "/resources/" in name}
    assert "wildlab/py.typed" in names
    assert {"environment.lock", "notebooks/studies.toml", "data/catalog.toml"} <= resources
    assert "data/twins/parts/vessel.toml" in resources
    with zipfile.ZipFile(installed.wheel) as archive:
        assert [name for name in names if archive.read(name) == b"planted"] == []
    assert [name for name in names if "__pycache__" in name] == []
    tops = {name.partition("/")[0] for name in names}
    assert len(tops) == 2 and "wildlab" in tops and min(tops - {"wildlab"}).endswith(".dist-info")


def test_all_that_git_holds_is_in_the_wheel(installed):
    """Also a kind of file that nobody has told `setup.py` about."""
    if shutil.which("git") is None or not (paths.ROOT / ".git").exists():
        pytest.skip("needs a git checkout")
    command = ["git", "ls-files", "-z", "wildlab", "notebooks", "data"]
    listed = subprocess.run(command, cwd=paths.ROOT, check=True, capture_output=True, text=True).stdout
    tracked = {name for name in listed.split("\0") if name and (paths.ROOT / name).is_file()}
    names = {name.removeprefix("wildlab/resources/") for name in shipped(installed.wheel)}
    assert len(tracked) > 100 and tracked - names == set()


def test_the_installed_code_is_what_runs_and_its_numbers_keep(installed):
    program = (
        f"import json, wildlab; from wildlab import paths; from {code_key.__module__} import code_key\n"
        "print(json.dumps([wildlab.__file__, str(paths.ROOT), str(paths.fetched()), code_key()]))"
    )
    done = installed.run(str(installed.python), "-c", program)
    assert done.returncode == 0, done.stderr
    file, root, fetched, key = json.loads(done.stdout)
    assert file == str(installed.packages / "wildlab" / "__init__.py")
    assert root == "None" and fetched.startswith(installed.environment["HOME"])
    assert key == code_key(), "seeds computed by a checkout and by its wheel are the same"


def test_commands_work_from_any_folder(installed):
    before = installed.files()
    assert "static-point" in installed.wildlab("list")
    assert "openathena" in installed.wildlab("fetch")
    told = installed.wildlab("doctor")
    assert "WRONG" not in told and "make " not in told
    assert str(installed.packages / "wildlab" / "resources") in told

    assert installed.wildlab("simulate", "static-antenna", "--out", "flights/antenna") == "flights/antenna\n"
    assert "georeferencing accuracy: yes" in installed.wildlab("check", "flights/antenna")
    assert installed.wildlab("run", "sensitivity") == "reports/index.html\n"

    report = installed.here / "reports" / "sensitivity"
    assert json.loads((report / "metrics.json").read_text(encoding="utf-8"))["metrics"]
    origin = json.loads((report / "provenance.json").read_text(encoding="utf-8"))
    assert origin["wildlab"]["note"] == "installed from a wheel"
    assert origin["wildlab"]["commit"] is None and origin["lock"]["sha256"]
    for file in ("report.html", "provenance.json", "notebook.ipynb"):
        text = (report / file).read_text(encoding="utf-8")
        for secret in (installed.here.parent, installed.packages, paths.ROOT):
            assert str(secret) not in text, f"{secret} in {file}"
    assert installed.files() == before, "nothing is written where packages are installed"
    assert {path.name for path in installed.here.iterdir()} == {"flights", "reports"}
