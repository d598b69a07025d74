"""What is wrong with this installation, and the fix: the answers behind ``wildlab doctor``.

Nothing here changes anything, asks the network, or imports the packages it looks at. Each check is one
function that gives one `Finding`; `examine` calls them all and takes well under two seconds.
"""

from __future__ import annotations

import os
import shutil
import sys
import tomllib
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from wildlab import paths

#: A full set of reports is some tens of megabytes; less than this and a run may stop half way.
ENOUGH_DISK_BYTES = 500_000_000
#: What wildlab reads.
RESOURCES = ("notebooks/studies.toml", "data/catalog.toml", "data/twins", "data/recipes", "data/published")
#: How many package names a sentence lists before it says "and 12 more".
LISTED = 4


class Finding(NamedTuple):
    """One thing looked at: whether it is well, its name, what was found, and what to do ("" for nothing)."""

    ok: bool
    name: str
    found: str
    fix: str = ""


def examine(root: Path | None = paths.ROOT) -> list[Finding]:
    """Look at the Python, its packages, the Jupyter kernel, what wildlab reads, and the place of reports.

    Parameters
    ----------
    root
        The checkout to look at, with ``environment.lock`` and ``pyproject.toml`` in it; None where wildlab
        was installed from a wheel, into an environment that is its owner's business.

    Returns
    -------
    list of Finding
        In the order in which they should be mended.
    """
    if root is None:
        packages = [check_packages(map(Requirement, metadata.requires("wildlab") or []))]
    else:
        packages = check_checkout(root)
    return [
        check_environment(root),
        *packages,
        check_resources(root or paths.RESOURCES),
        check_kernel(),
        check_reports_folder(root / "reports" if root else paths.REPORTS.absolute()),
    ]


def check_environment(root: Path | None, prefix: str = sys.prefix) -> Finding:
    """Does wildlab run in the checkout's own ``.venv``, and is nothing slipped in from outside?"""
    name = "environment"
    wanted = Path(prefix) if root is None else root / ".venv"
    if Path(prefix).resolve() != wanted.resolve():
        fix = f"Run it as {wanted / 'bin' / 'wildlab'}, or through make."
        return Finding(False, name, f"running in {prefix}, not in {wanted}", fix)
    slipped = [variable for variable in ("PYTHONPATH", "PYTHONHOME") if os.environ.get(variable)]
    if slipped:
        found = f"{slipped[0]} is set and may bring in foreign packages"
        return Finding(False, name, found, f"Unset it: 'unset {slipped[0]}'.")
    return Finding(True, name, f"{wanted}, Python {sys.version.split()[0]}")


def check_checkout(root: Path, installed: Mapping[str, str] | None = None) -> list[Finding]:
    """Are the packages here those of the lock, and does that hold what ``pyproject.toml`` asks for?

    Compared by what they say: the files' dates mean nothing after a clone.
    """
    lock, project = root / "environment.lock", root / "pyproject.toml"
    try:
        pins = read_lock(lock)
        about = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
        several = [about.get("dependencies", []), *about.get("optional-dependencies", {}).values()]
        wishes = [Requirement(text) for texts in several for text in texts]
    except (OSError, ValueError, KeyError) as error:
        fix = f"Restore them: 'git checkout {lock.name} {project.name}'."
        return [Finding(False, "lock", f"{lock.name} or {project.name} cannot be read: {error}", fix)]
    fix = "Run 'make environment'; if that finds nothing to do, 'make clean environment'."
    locked: dict[str, str] = {canonicalize_name(pin.name): next(iter(pin.specifier)).version for pin in pins}
    behind = _unmet(wishes, locked)
    found = f"older than pyproject.toml, which asks for {_few(behind)}" if behind else "up to date"
    return [
        check_packages(pins, installed, fix),
        Finding(not behind, "lock", found, "Run 'make lock'." if behind else ""),
    ]


def read_lock(lock: Path) -> list[Requirement]:
    """The pins of a lock file that apply to this Python and machine.

    Raises
    ------
    OSError, ValueError
        The file cannot be read, or a line of it is no requirement.
    """
    lines = (line.removesuffix("\\").strip() for line in lock.read_text(encoding="utf-8").splitlines())
    pins = [Requirement(line) for line in lines if line and not line.startswith(("#", "--"))]
    return [pin for pin in pins if pin.marker is None or pin.marker.evaluate()]


def check_packages(
    wishes: Iterable[Requirement], installed: Mapping[str, str] | None = None, fix: str = ""
) -> Finding:
    """Is everything here that is wanted, in versions that are?"""
    if installed is None:
        named = ((item.metadata["Name"], item.version) for item in metadata.distributions())
        installed = {canonicalize_name(name): version for name, version in named if name}
    if unmet := _unmet(wishes, installed):
        asked = " ".join(f"'{one.partition(' ')[0]}'" for one in unmet)
        fix = fix or f"Run 'python -m pip install' with {asked}."
        return Finding(False, "packages", f"wanted: {_few(unmet)}", fix)
    return Finding(True, "packages", "all that are wanted")


def _unmet(wishes: Iterable[Requirement], versions: Mapping[str, str]) -> list[str]:
    """The requirements that ``versions`` (by canonical name) does not meet, extras left out."""
    unmet = []
    for wish in wishes:
        if wish.marker is not None and not wish.marker.evaluate({"extra": ""}):
            continue
        version = versions.get(canonicalize_name(wish.name))
        if version is None or not wish.specifier.contains(version, prereleases=True):
            here = f" ({version} is here)" if version else ""
            unmet.append(f"{wish.name}{wish.specifier}{here}")
    return unmet


def _few(names: list[str]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def check_resources(folder: Path) -> Finding:
    """Is there what wildlab reads: studies, twins, recipes, published numbers?"""
    name = "notebooks and data"
    if missing := [entry for entry in RESOURCES if not (folder / entry).exists()]:
        fix = "Install wildlab again (in a checkout: 'git checkout notebooks data')."
        return Finding(False, name, f"{_few(missing)} not in {folder}", fix)
    return Finding(True, name, f"in {folder}")


def check_kernel() -> Finding:
    """Would a notebook's kernel ``python3`` be this very Python?"""
    from jupyter_client.kernelspec import KernelSpecManager, NoSuchKernel

    try:
        program = (*KernelSpecManager().get_kernel_spec("python3").argv, "")[0]
    except NoSuchKernel:
        fix = f"Run '{sys.executable} -m ipykernel install --sys-prefix'."
        return Finding(False, "kernel", "Jupyter finds no kernel named python3", fix)
    # Jupyter itself replaces a bare "python" by the interpreter it runs in. Not resolved: the interpreter in
    # .venv/bin is a link to the one that it was made from.
    bare = program.startswith("python") and Path(program).name == program
    if bare or Path(program).absolute() == Path(sys.executable).absolute():
        return Finding(True, "kernel", f"python3 is {program}")
    fix = "Set JUPYTER_PREFER_ENV_PATH=1, or run 'jupyter kernelspec remove python3'."
    return Finding(False, "kernel", f"python3 is {program}, not {sys.executable}", fix)


def check_reports_folder(reports: Path, free: int | None = None) -> Finding:
    """Can a run write its report, and is there room for all of them?"""
    where = reports if reports.exists() else reports.parent
    if not where.is_dir() or not os.access(where, os.W_OK | os.X_OK):
        fix = "Change its rights or move it away, or give another with --out."
        return Finding(False, "reports folder", f"{where} is no folder that can be written to", fix)
    free = shutil.disk_usage(where).free if free is None else free
    found = f"{reports}, {free / 1e9:.1f} GB free"
    fix = "" if free >= ENOUGH_DISK_BYTES else f"Free {ENOUGH_DISK_BYTES / 1e9:.1f} GB before a run."
    return Finding(not fix, "reports folder", found, fix)
