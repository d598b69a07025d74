"""What kept numbers depend on: two machines with the same fingerprint compute the same thing."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from wildlab.paths import DATA, PACKAGE

#: A change in any of these rooms can change a number.
ROOMS = (
    "geometry",
    "flight",
    "simulation",
    "navigation",
    "detection",
    "tracking",
    "planning",
    "evaluation",
    "analysis",
)
#: Of the studies their trials can; how they are shown and said cannot.
TRIALS = ("studies/*/trial.py", "studies/*/trial/*.py")
#: Packages below them whose version can.
PACKAGES = (
    "filterpy",
    "numba",
    "numpy",
    "opencv-python-headless",
    "pandas",
    "pyarrow",
    "pymap3d",
    "pyproj",
    "rasterio",
    "scipy",
)


def trial_key(case: str, parameters: Mapping[str, Any], code: str) -> str:
    """What a trial's numbers depend on besides the seed, as 64 hexadecimal digits. ``code``: `code_key`."""
    text = json.dumps([case, dict(parameters), code], sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def page_key(notebook: Path, given: Mapping[str, Any], code: str) -> str:
    """What a study's page depends on, as 64 hexadecimal digits: `code_key`, how it is shown and said, what is
    published, the notebook, and ``given``, whatever the notebook is given."""
    rooms = ("studies", "reporting", "messages")
    shown = [path for room in rooms for path in (PACKAGE / room).rglob("*.py")]
    texts = [*(DATA / "published").glob("*.toml"), *(DATA / "messages").rglob("*.toml")]
    digest = hashlib.sha256(json.dumps([code, dict(given)], sort_keys=True, allow_nan=False).encode())
    for path in [*sorted([*shown, DATA / "glossary.toml", *texts]), notebook]:
        digest.update(path.name.encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def code_key() -> str:
    """The code of all trials and below them, the twins' parameters and the packages' versions, as 64
    hexadecimal digits."""
    code = [path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")] + [
        path for pattern in TRIALS for path in PACKAGE.glob(pattern)
    ]
    # Twins share parts, so a change of any of their files may be a change of each. Named as in a checkout, so
    # that a wheel of the same code has the same key.
    named = [(f"wildlab/{path.relative_to(PACKAGE).as_posix()}", path) for path in code]
    named += [
        (f"data/{path.relative_to(DATA).as_posix()}", path) for path in (DATA / "twins").rglob("*.toml")
    ]
    versions = [f"{package} {_version(package)}" for package in PACKAGES]
    digest = hashlib.sha256(" ".join([*platform.python_version_tuple()[:2], *versions]).encode())
    for name, path in sorted(named):
        digest.update(name.encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"
