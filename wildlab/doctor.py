"""What is wrong with this installation, and the fix: the answers behind ``wildlab doctor``.

Nothing here changes anything, asks the network, or imports the packages it looks at. Each check is one
function that gives one `Finding`; `examine` calls them all and takes well under two seconds.
"""

from __future__ import annotations

import os
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement
from packaging.utils import canonicalize_name

from wildlab import paths

#: A full set of reports is some tens of megabytes; less than this and a run may stop half way.
ENOUGH_DISK_BYTES = 500_000_000
OLDEST_PYTHON = (3, 11)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: How many package names a sentence lists before it says "and 12 more".
LISTED = 4


@dataclass(frozen=True)
class Finding:
    """One thing looked at: whether it is well, its name, what was found, and what to do ("" for nothing).

    A finding that is ``ok`` and still carries a fix is a note: something optional is absent.
    """

    ok: bool
    name: str
    found: str
    fix: str = ""


def examine(root: Path | None = paths.ROOT) -> list[Finding]:
    """Look at the Python, its packages, the Jupyter kernel, the disk and the tools around them.

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
        wishes = metadata.requires("wildlab") or []
        packages = [check_requirements(wishes), check_tested_versions(paths.LOCK)]
    else:
        lock = root / "environment.lock"
        packages = [check_packages(lock), check_lock(lock, root / "pyproject.toml")]
    return [
        check_python(),
        check_environment(root),
        *packages,
        check_resources(root or paths.RESOURCES),
        check_kernel(),
        check_reports_folder(root / "reports" if root else paths.REPORTS.absolute()),
        check_disk(root or Path.cwd()),
        *([check_git(root)] if root else []),
        check_mirror(),
        *([check_browser()] if root else []),
    ]


def check_python(version: tuple[int, ...] = sys.version_info[:3]) -> Finding:
    """Is this Python new enough?"""
    found = ".".join(str(part) for part in version)
    if version[:2] < OLDEST_PYTHON:
        fix = "Install wildlab with a newer one (in a checkout: 'make PYTHON=python3.12 environment')."
        return Finding(False, "Python", found, fix)
    return Finding(True, "Python", found)


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
        fix = f"Unset it: 'unset {slipped[0]}'."
        return Finding(False, name, found, fix)
    return Finding(True, name, str(wanted))


def read_lock(lock: Path) -> list[Requirement]:
    """The pins of a lock file that apply to this Python and machine.

    Raises
    ------
    OSError, ValueError
        The file cannot be read, or a line of it is no requirement.
    """
    pins = []
    for line in lock.read_text(encoding="utf-8").splitlines():
        text = line.removesuffix("\\").strip()
        if not text or text.startswith(("#", "--")):
            continue
        try:
            pin = Requirement(text)
        except InvalidRequirement as error:
            raise ValueError(f"{text[:60]!r} is not a requirement") from error
        if pin.marker is None or pin.marker.evaluate():
            pins.append(pin)
    return pins


def _installed() -> dict[str, str]:
    names = ((item.metadata["Name"], item.version) for item in metadata.distributions())
    return {canonicalize_name(name): version for name, version in names if name}


def _few(names: list[str]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def check_packages(lock: Path, installed: Mapping[str, str] | None = None) -> Finding:
    """Are the packages installed here those of the lock, markers considered?"""
    name = "packages"
    fix = "Run 'make environment'; if that finds nothing to do, 'make clean environment'."
    try:
        pins = read_lock(lock)
    except (OSError, ValueError) as error:
        restore = "Restore it: 'git checkout environment.lock'."
        return Finding(False, name, f"{lock} cannot be read: {error}", restore)
    here = _installed() if installed is None else installed
    missing = [pin.name for pin in pins if canonicalize_name(pin.name) not in here]
    different = _different(pins, here)
    wrong = []
    if missing:
        wrong.append(f"missing: {_few(missing)}")
    if different:
        wrong.append(f"different from environment.lock: {_few(different)}")
    if wrong:
        return Finding(False, name, "; ".join(wrong), fix)
    return Finding(True, name, f"{len(pins)}, as environment.lock says")


def _different(pins: Iterable[Requirement], versions: Mapping[str, str]) -> list[str]:
    """What is there in another version than its pin's, in words."""
    found = [(pin, versions.get(canonicalize_name(pin.name))) for pin in pins]
    return [
        f"{pin.name} {version} instead of {str(pin.specifier).removeprefix('==')}"
        for pin, version in found
        if version is not None and not pin.specifier.contains(version, prereleases=True)
    ]


def check_requirements(wishes: Iterable[str], installed: Mapping[str, str] | None = None) -> Finding:
    """Is everything here that an installed wildlab asks for, in versions that it can use?"""
    name = "packages"
    unmet = _unmet(wishes, _installed() if installed is None else installed)
    if unmet:
        packages = " ".join(f"'{wish}'" for wish in unmet)
        fix = f"Run 'python -m pip install' with {packages}."
        return Finding(False, name, f"wildlab asks for {_few(unmet)}", fix)
    return Finding(True, name, "all that wildlab asks for")


def check_tested_versions(lock: Path, installed: Mapping[str, str] | None = None) -> Finding:
    """Are the packages those that the numbers were tested with? Others may do, so this is a note."""
    name = "tested versions"
    try:
        pins = read_lock(lock)
    except (OSError, ValueError) as error:
        return Finding(False, name, f"{lock} cannot be read: {error}", "Install the wheel again.")
    different = _different(pins, _installed() if installed is None else installed)
    if different:
        found = f"different from environment.lock: {_few(different)}"
        fix = f"Last digits may differ; 'python -m pip install -r {lock}' takes what was tested."
        return Finding(True, name, found, fix)
    return Finding(True, name, "as environment.lock says")


def _unmet(wishes: Iterable[str], versions: Mapping[str, str]) -> list[str]:
    """The requirements that ``versions`` (by canonical name) does not meet, extras left out."""
    unmet = []
    for wish in map(Requirement, wishes):
        if wish.marker is not None and not wish.marker.evaluate({"extra": ""}):
            continue
        version = versions.get(canonicalize_name(wish.name))
        if version is None or not wish.specifier.contains(version, prereleases=True):
            unmet.append(f"{wish.name}{wish.specifier}")
    return unmet


def check_lock(lock: Path, pyproject: Path) -> Finding:
    """Does the lock hold everything that ``pyproject.toml`` asks for?

    Compared by what they say: the files' dates mean nothing after a clone.
    """
    name = "lock"
    try:
        pins = {
            canonicalize_name(pin.name): next((item.version for item in pin.specifier), "")
            for pin in read_lock(lock)
        }
        project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
        texts = [*project.get("dependencies", [])]
        for extra in project.get("optional-dependencies", {}).values():
            texts += extra
        behind = _unmet(texts, {name: version for name, version in pins.items() if version})
    except (OSError, ValueError, KeyError) as error:
        return Finding(False, name, f"cannot be compared with {pyproject}: {error}", "Restore both from git.")
    if behind:
        found = f"older than pyproject.toml, which asks for {_few(behind)}"
        return Finding(False, name, found, "Run 'make lock'.")
    return Finding(True, name, "environment.lock answers pyproject.toml")


def check_resources(folder: Path) -> Finding:
    """Is there what wildlab reads: studies, twins, recipes, published numbers?"""
    name = "notebooks and data"
    needed = ("notebooks/studies.toml", "data/catalog.toml", "data/twins", "data/recipes", "data/published")
    missing = [entry for entry in needed if not (folder / entry).exists()]
    if missing:
        fix = "Install wildlab again (in a checkout: 'git checkout notebooks data')."
        return Finding(False, name, f"{_few(missing)} not in {folder}", fix)
    return Finding(True, name, f"in {folder}")


def check_kernel() -> Finding:
    """Would a notebook's kernel ``python3`` be this very Python?"""
    name = "kernel"
    from jupyter_client.kernelspec import KernelSpecManager, NoSuchKernel

    try:
        spec = KernelSpecManager().get_kernel_spec("python3")
    except NoSuchKernel:
        fix = f"Run '{sys.executable} -m ipykernel install --sys-prefix'."
        return Finding(False, name, "Jupyter finds no kernel named python3", fix)
    program = spec.argv[0] if spec.argv else ""
    # Jupyter itself replaces a bare "python" by the interpreter it runs in.
    if program.startswith("python") and "/" not in program and "\\" not in program:
        return Finding(True, name, f"python3 is this Python ({sys.executable})")
    # Not resolved: the interpreter in .venv/bin is a link to the one that it was made from.
    if Path(program).absolute() == Path(sys.executable).absolute():
        return Finding(True, name, f"python3 is {program}")
    fix = "Set JUPYTER_PREFER_ENV_PATH=1, or run 'jupyter kernelspec remove python3'."
    return Finding(False, name, f"python3 in {spec.resource_dir} starts {program}, not {sys.executable}", fix)


def check_reports_folder(reports: Path) -> Finding:
    """Can a run write its report?"""
    name = "reports folder"
    where = reports if reports.exists() else reports.parent
    if not where.is_dir():
        return Finding(False, name, f"{where} is not a folder", "Move it away, or give another with --out.")
    if not os.access(where, os.W_OK | os.X_OK):
        fix = "Change its rights, or give another with --out."
        return Finding(False, name, f"{where} cannot be written to", fix)
    return Finding(True, name, f"{reports} can be written to")


def check_disk(root: Path, free: int | None = None) -> Finding:
    """Is there room for a set of reports?"""
    name = "disk"
    free = shutil.disk_usage(root).free if free is None else free
    found = f"{free / 1e9:.1f} GB free"
    if free < ENOUGH_DISK_BYTES:
        return Finding(False, name, found, f"Free at least {ENOUGH_DISK_BYTES / 1e9:.1f} GB before a run.")
    return Finding(True, name, found)


def check_git(root: Path) -> Finding:
    """Can provenance name the commit? Reports are made without it too, but then say less."""
    name = "git"
    program = shutil.which("git")
    if program is None:
        found = "not found: reports cannot name the commit they were made with"
        return Finding(True, name, found, "Install git.")
    if not (root / ".git").exists():
        found = "not a git checkout: reports cannot name the commit they were made with"
        return Finding(True, name, found, "Use 'git clone' instead of an unpacked archive.")
    return Finding(True, name, program)


def check_mirror(environ: Mapping[str, str] = os.environ) -> Finding:
    """Where data sets would come from."""
    name = "data sets"
    mirror = environ.get("WILDLAB_DATA_MIRROR", "")
    if not mirror:
        return Finding(True, name, "fetched from where they are published (WILDLAB_DATA_MIRROR is not set)")
    if not Path(mirror).is_dir():
        fix = "Set it to a folder that exists, or unset it to fetch from the network."
        return Finding(False, name, f"WILDLAB_DATA_MIRROR is {mirror}, which is not a folder", fix)
    return Finding(True, name, f"taken from {mirror} (WILDLAB_DATA_MIRROR)")


def check_browser(which: Callable[[str], str | None] = shutil.which) -> Finding:
    """Is there a Chromium for the test that opens every report? Nothing else needs one."""
    name = "browser for tests"
    program = next((found for found in map(which, BROWSERS) if found), None)
    if program is None:
        fix = "To run them, install Chromium (Debian and Ubuntu: 'apt-get install chromium')."
        return Finding(True, name, "no Chromium found: the tests that open reports are skipped", fix)
    return Finding(True, name, program)
