"""Each check of the doctor, once well and once for each thing that it promises to notice."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from wildlab import doctor, paths

LOCK = """\
# made by hand
affine==3.0.1 \\
    --hash=sha256:cda3b303325e7bf2bf34817e68753a0d1c4cacbdd451fe67c4878dc2ecbaa540
    # via rasterio
numpy==2.4.6 ; python_full_version >= '3' \\
    --hash=sha256:0133c3c3b54a0bf1e71fa5c1ad95c93f07fd54e24ef1fe182f5122e1573d2bf1
pywinpty==3.1.2 ; python_full_version < '3' \\
    --hash=sha256:038c2c7e8caa26b6c8423779b5eaf1893904048a512c19b32fe841ffa5592b50
Send2Trash==1.8 \\
    --hash=sha256:0684952aeae1f5dbfe02d46039338513b94009baecd15d8e4098a357c4c4a2a6
"""
INSTALLED = {"affine": "3.0.1", "numpy": "2.4.6", "send2trash": "1.8"}


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    path = tmp_path / "environment.lock"
    path.write_text(LOCK, encoding="utf-8")
    return path


def write_pyproject(folder: Path, *dependencies: str, extra: str = "affine") -> Path:
    path = folder / "pyproject.toml"
    path.write_text(
        f"[project]\nname = 'x'\ndependencies = {json.dumps(dependencies)}\n"
        f"[project.optional-dependencies]\ndev = [{json.dumps(extra)}]\n",
        encoding="utf-8",
    )
    return path


def test_examines_this_checkout() -> None:
    findings = doctor.examine()
    assert len({finding.name for finding in findings}) == len(findings) == 11
    for finding in findings:
        assert finding.found
        assert finding.ok or finding.fix
        assert not finding.fix or finding.fix.endswith(".")


def test_examines_an_installed_wildlab(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Without a checkout there is no make, no git and no lock that the environment has to follow."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.setattr(paths, "REPORTS", Path("reports"))
    findings = {finding.name: finding for finding in doctor.examine(None)}
    assert findings["environment"] == doctor.Finding(True, "environment", sys.prefix)
    assert findings["packages"].ok and findings["notebooks and data"].ok
    assert findings["reports folder"].found.startswith(str(tmp_path))
    assert not {"lock", "git", "browser for tests"} & set(findings)
    assert not [finding for finding in findings.values() if "make " in finding.found + finding.fix]


def test_what_an_installed_wildlab_asks_for() -> None:
    wishes = ["Affine>=3", "numpy>=2", "polars", "ruff; extra == 'dev'", "colorama; python_version < '3'"]
    finding = doctor.check_requirements(wishes, INSTALLED | {"affine": "2.4"})
    assert not finding.ok and finding.found == "wildlab asks for Affine>=3, polars"
    assert finding.fix == "Run 'python -m pip install' with 'Affine>=3' 'polars'."
    assert doctor.check_requirements(wishes[:2], INSTALLED).ok


def test_other_versions_than_those_tested_are_a_note(lock: Path, tmp_path: Path) -> None:
    assert doctor.check_tested_versions(lock, {"affine": "3.0.1"}).fix == ""
    finding = doctor.check_tested_versions(lock, {"numpy": "2.4.7"})
    assert finding.ok and "numpy 2.4.7 instead of 2.4.6" in finding.found
    assert f"pip install -r {lock}" in finding.fix
    assert not doctor.check_tested_versions(tmp_path / "gone", {}).ok


def test_notebooks_and_data_that_are_missing_are_named(tmp_path: Path) -> None:
    assert doctor.check_resources(paths.RESOURCES).ok
    finding = doctor.check_resources(tmp_path)
    assert not finding.ok and "notebooks/studies.toml" in finding.found


def test_this_environment_is_what_its_lock_says() -> None:
    """The tests are meant to run where ``make`` put the packages; elsewhere their results prove little."""
    if Path(sys.prefix).resolve() != (paths.ROOT / ".venv").resolve():
        pytest.skip("not running in the project's own environment")
    assert doctor.check_packages(paths.LOCK).ok, doctor.check_packages(paths.LOCK)
    assert doctor.check_lock(paths.LOCK, paths.ROOT / "pyproject.toml").ok
    assert doctor.check_kernel().ok


def test_old_python() -> None:
    assert doctor.check_python((3, 11, 0)).ok
    finding = doctor.check_python((3, 10, 13))
    assert not finding.ok
    assert finding.found == "3.10.13"
    assert "make PYTHON=" in finding.fix


def test_outside_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.delenv("PYTHONHOME", raising=False)
    (tmp_path / ".venv").mkdir()
    assert doctor.check_environment(tmp_path, str(tmp_path / ".venv")).ok
    finding = doctor.check_environment(tmp_path, "/usr")
    assert not finding.ok
    assert "/usr" in finding.found
    assert str(tmp_path / ".venv") in finding.fix


def test_foreign_packages_slipped_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/opt/ros/python")
    finding = doctor.check_environment(tmp_path, str(tmp_path / ".venv"))
    assert not finding.ok
    assert "PYTHONPATH" in finding.found
    assert "PYTHONPATH" in finding.fix


def test_lock_is_read_with_markers(lock: Path) -> None:
    assert [pin.name for pin in doctor.read_lock(lock)] == ["affine", "numpy", "Send2Trash"]


def test_packages_as_locked(lock: Path) -> None:
    finding = doctor.check_packages(lock, INSTALLED)
    assert finding.ok
    assert finding.found.startswith("3,")


def test_packages_that_drifted_are_named(lock: Path) -> None:
    finding = doctor.check_packages(lock, {"affine": "3.0.1", "numpy": "2.4.7"})
    assert not finding.ok
    assert "missing: Send2Trash" in finding.found
    assert "numpy 2.4.7 instead of 2.4.6" in finding.found
    assert "affine" not in finding.found
    assert "make environment" in finding.fix


def test_a_long_list_of_packages_is_cut_short(lock: Path) -> None:
    lock.write_text("".join(f"package{n}==1\n" for n in range(9)), encoding="utf-8")
    finding = doctor.check_packages(lock, {})
    assert finding.found == "missing: package0, package1, package2, package3 and 5 more"


@pytest.mark.parametrize("text", ["not a requirement at all !!\n", None])
def test_unreadable_lock(tmp_path: Path, text: str | None) -> None:
    lock = tmp_path / "environment.lock"
    if text is not None:
        lock.write_text(text, encoding="utf-8")
    assert not doctor.check_packages(lock, {}).ok
    assert not doctor.check_lock(lock, write_pyproject(tmp_path, "affine>=3")).ok


def test_lock_behind_pyproject(lock: Path, tmp_path: Path) -> None:
    assert doctor.check_lock(lock, write_pyproject(tmp_path, "affine>=3", "send2trash", "numpy>=2")).ok
    assert doctor.check_lock(lock, write_pyproject(tmp_path, "colorama; python_version < '3'")).ok
    for wanted, extra in (("affine>=3.1", "numpy"), ("polars", "numpy"), ("affine>=3", "ruff>=0.6")):
        finding = doctor.check_lock(lock, write_pyproject(tmp_path, wanted, extra=extra))
        assert not finding.ok
        assert "older than pyproject.toml" in finding.found
        assert finding.fix == "Run 'make lock'."


def write_kernel(folder: Path, program: str) -> None:
    kernel = folder / "kernels" / "python3"
    kernel.mkdir(parents=True)
    argv = [program, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    (kernel / "kernel.json").write_text(json.dumps({"argv": argv, "display_name": "x"}), encoding="utf-8")


def test_kernel_of_another_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_kernel(tmp_path, "/usr/bin/python3")
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    finding = doctor.check_kernel()
    assert not finding.ok
    assert "/usr/bin/python3" in finding.found
    assert finding.fix


@pytest.mark.parametrize("program", ["python", sys.executable])
def test_kernel_of_this_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    write_kernel(tmp_path, program)
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    assert doctor.check_kernel().ok


def test_reports_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctor.check_reports_folder(tmp_path / "reports").ok
    (tmp_path / "file").touch()
    assert "is not a folder" in doctor.check_reports_folder(tmp_path / "file").found
    # Whoever runs this may be root, to whom every folder is open: ask the check, not the disk.
    monkeypatch.setattr("os.access", lambda *_: False)
    finding = doctor.check_reports_folder(tmp_path)
    assert not finding.ok
    assert "cannot be written" in finding.found


def test_disk(tmp_path: Path) -> None:
    assert doctor.check_disk(tmp_path, free=2_000_000_000).ok
    finding = doctor.check_disk(tmp_path, free=100_000_000)
    assert not finding.ok
    assert finding.found == "0.1 GB free"


def test_git_is_optional_but_missed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda _: "/usr/bin/git")
    assert "not a git checkout" in doctor.check_git(tmp_path).found
    (tmp_path / ".git").mkdir()
    assert doctor.check_git(tmp_path) == doctor.Finding(True, "git", "/usr/bin/git")
    monkeypatch.setattr("shutil.which", lambda _: None)
    assert doctor.check_git(tmp_path).ok
    assert doctor.check_git(tmp_path).fix == "Install git."


def test_mirror(tmp_path: Path) -> None:
    assert doctor.check_mirror({}).ok
    assert doctor.check_mirror({"WILDLAB_DATA_MIRROR": str(tmp_path)}).ok
    finding = doctor.check_mirror({"WILDLAB_DATA_MIRROR": str(tmp_path / "gone")})
    assert not finding.ok
    assert str(tmp_path / "gone") in finding.found


def test_browser_is_optional() -> None:
    assert doctor.check_browser({"google-chrome": "/opt/chrome"}.get).found == "/opt/chrome"
    finding = doctor.check_browser(lambda _: None)
    assert finding.ok
    assert finding.fix
