"""Each check of the doctor, once well and once for each thing that it promises to notice."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

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
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "environment.lock").write_text(LOCK, encoding="utf-8")
    return tmp_path


def write_pyproject(folder: Path, *dependencies: str, extra: str = "affine") -> Path:
    path = folder / "pyproject.toml"
    path.write_text(
        f"[project]\nname = 'x'\ndependencies = {json.dumps(dependencies)}\n"
        f"[project.optional-dependencies]\ndev = [{json.dumps(extra)}]\n",
        encoding="utf-8",
    )
    return path


def test_examines_this_checkout():
    findings = doctor.examine()
    assert len({finding.name for finding in findings}) == len(findings) == 6
    assert all(finding.found and (finding.ok or finding.fix) for finding in findings)


def test_examines_an_installed_wildlab(monkeypatch, tmp_path):
    """Without a checkout there is no make and no lock that the environment has to follow."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.setattr(paths, "REPORTS", Path("reports"))
    findings = {finding.name: finding for finding in doctor.examine(None)}
    assert findings["environment"].ok and findings["environment"].found.startswith(sys.prefix)
    assert findings["packages"].ok and findings["notebooks and data"].ok
    assert "lock" not in findings
    assert not [finding for finding in findings.values() if "make " in finding.found + finding.fix]


def test_what_an_installed_wildlab_asks_for():
    wishes = ["Affine>=3", "numpy>=2", "polars", "ruff; extra == 'dev'", "colorama; python_version < '3'"]
    asked = [Requirement(one) for one in wishes]
    finding = doctor.check_packages(asked, INSTALLED | {"affine": "2.4"})
    assert not finding.ok and "'Affine>=3' 'polars'" in finding.fix
    assert doctor.check_packages(asked[:2], INSTALLED).ok


def test_this_environment_is_what_its_lock_says():
    """The tests are meant to run where ``make`` put the packages; elsewhere their results prove little."""
    if Path(sys.prefix).resolve() != (paths.ROOT / ".venv").resolve():
        pytest.skip("not running in the project's own environment")
    found = doctor.check_checkout(paths.ROOT)
    assert all(one.ok for one in found), found
    assert doctor.check_kernel().ok


def test_resources_and_reports_folder(tmp_path):
    for well, ill in (
        (doctor.check_resources(paths.RESOURCES), doctor.check_resources(tmp_path)),
        *(
            (doctor.check_reports_folder(tmp_path, free=500_000_000), one)
            for one in (
                doctor.check_reports_folder(tmp_path, free=499_999_999),
                doctor.check_reports_folder(tmp_path / "gone" / "reports"),
            )
        ),
    ):
        assert well.ok and not ill.ok and ill.fix, ill.name


def test_an_environment_of_another_python_or_with_foreign_packages(tmp_path, monkeypatch):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.delenv("PYTHONHOME", raising=False)
    own = str(tmp_path / ".venv")
    assert doctor.check_environment(tmp_path, own).ok
    assert not doctor.check_environment(tmp_path, "/usr").ok
    monkeypatch.setenv("PYTHONPATH", "/opt/ros/python")
    finding = doctor.check_environment(tmp_path, own)
    assert not finding.ok and "PYTHONPATH" in finding.fix


def test_packages_that_drifted_are_named(checkout):
    write_pyproject(checkout, "affine>=3")
    assert all(one.ok for one in doctor.check_checkout(checkout, INSTALLED))
    finding, lock = doctor.check_checkout(checkout, {"affine": "3.0.1", "numpy": "2.4.7"})
    assert not finding.ok and "Send2Trash" in finding.found and "2.4.7 is here" in finding.found
    assert "affine" not in finding.found and lock.ok


def test_lock_behind_pyproject(checkout):
    def answers(*wanted: str, extra: str = "affine") -> bool:
        write_pyproject(checkout, *wanted, extra=extra)
        return doctor.check_checkout(checkout, INSTALLED)[-1].ok

    assert answers("affine>=3", "send2trash", "numpy>=2") and answers("colorama; python_version < '3'")
    assert not answers("affine>=3.1", extra="numpy") and not answers("polars")
    assert not answers("affine>=3", extra="ruff>=0.6")
    (checkout / "environment.lock").write_text("no requirement !", encoding="utf-8")
    assert not answers("affine>=3")


@pytest.mark.parametrize(
    ("program", "ok"), [("/usr/bin/python3", False), ("python", True), (sys.executable, True)]
)
def test_kernel_of_this_python_or_another(tmp_path, monkeypatch, program, ok):
    kernel = tmp_path / "kernels" / "python3"
    kernel.mkdir(parents=True)
    argv = [program, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    (kernel / "kernel.json").write_text(json.dumps({"argv": argv, "display_name": "x"}), encoding="utf-8")
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    assert doctor.check_kernel().ok == ok
