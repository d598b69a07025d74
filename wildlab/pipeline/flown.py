"""Studies over many simulated flights: what is computed for each seed, by its name in ``studies.toml``.

To add one, write a pure function beside the study's other steps and list it in `FLOWN`::

    def fly(seed: int, *, twin: str, runs: int) -> dict[tuple[str, str], float]:
        flight = simulate_twin(twin, seed)
        ...
        return {("kalman", "rmse_north"): 1.8, ...}

- It gets the seed and, by keyword, the parameters listed beside it: ``twin`` is the study's twin, the others
  are parameters of the study in ``studies.toml``. Each must be given; none has a default.
- It depends on nothing else: no file but those of ``data/``, no clock, no state. Randomness comes from the
  seed.
- It gives numbers by (subject, name), the same names for each seed; NaN stands for what this flight has no
  value for. Neither a subject nor a name has a ``/`` in it.
- A flight from which nothing can be concluded (no solution, no observations) raises: `WildlabError` with a
  sentence. The run then names the seed. It never returns NaN throughout in place of an error.

Then say ``each_seed = "its-name"`` and ``seeds = 100`` in ``studies.toml``, and read the table in the
notebook with `wildlab.reporting.seeds.seeds_table`.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import platform
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.paths import DATA, PACKAGE


class Flown(NamedTuple):
    """Where a function is (``module:function``) and which parameters it takes besides the seed."""

    target: str
    parameters: tuple[str, ...] = ()


#: The only functions that a study can name.
FLOWN: dict[str, Flown] = {
    "static-point": Flown("wildlab.pipeline.at_rest:fly", ("twin",)),
    "slow-vessel": Flown("wildlab.pipeline.slow_vessel:fly", ("twin", "first")),
    "navigation": Flown("wildlab.pipeline.navigation_errors:fly", ("twin",)),
    "schmidt": Flown("wildlab.pipeline.schmidt_study:fly", ("twin",)),
    "linear-vs-nonlinear": Flown("wildlab.pipeline.linear_vs_nonlinear:fly", ("twin",)),
    "coloured-noise": Flown("wildlab.pipeline.coloured_noise:fly", ("twin",)),
}

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
    "pipeline",
)
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

Values = dict[str, float]


def find_flown(name: str) -> Flown:
    """The entry of that name.

    Raises
    ------
    WildlabError
        If there is none.
    """
    if name not in FLOWN:
        raise WildlabError(
            f"nothing named {name!r} is computed for each seed",
            f"use one of: {', '.join(FLOWN)}; or add it to wildlab/pipeline/flown.py",
            field="each_seed",
        )
    return FLOWN[name]


def fly_seed(name: str, seed: int, parameters: Mapping[str, Any]) -> Values:
    """What the function of that name gives for a seed, by "subject/name".

    Raises
    ------
    WildlabError
        If there is no such function or what it gives is not numbers by (subject, name); and whatever the
        function raises.
    """
    module, _, function = find_flown(name).target.partition(":")
    fly: Callable[..., Mapping[tuple[str, str], float]] = getattr(importlib.import_module(module), function)
    values = {f"{subject}/{what}": float(value) for (subject, what), value in fly(seed, **parameters).items()}
    wrong = next((key for key in values if key.count("/") != 1), None)
    if not values or wrong is not None:
        found = "gives nothing" if wrong is None else f"names a number {wrong!r}"
        raise WildlabError(
            f"what is computed for each seed of {name!r} {found}", "give numbers by (subject, name)"
        )
    return values


def work_key(name: str, parameters: Mapping[str, Any], code: str) -> str:
    """What a seed's numbers depend on besides the seed, as 64 hexadecimal digits. ``code``: `code_key`."""
    text = json.dumps([name, *find_flown(name), dict(parameters), code], sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def code_key() -> str:
    """The code below `wildlab.reporting`, the twins' parameters and the packages' versions, as 64 hexadecimal
    digits. Two machines on which it is the same compute the same thing."""
    # Named as in a checkout, so that an installed wildlab of the same code has the same key.
    modules = (path for room in ROOMS for path in (PACKAGE / room).rglob("*.py"))
    code = {"wildlab" / path.relative_to(PACKAGE): path for path in modules}
    # Twins share parts, so a change of any of their files may be a change of each.
    twins = {"data" / path.relative_to(DATA): path for path in (DATA / "twins").rglob("*.toml")}
    versions = [f"{package} {_version(package)}" for package in PACKAGES]
    digest = hashlib.sha256(" ".join([*platform.python_version_tuple()[:2], *versions]).encode())
    for name, path in sorted((code | twins).items()):
        digest.update(name.as_posix().encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"
