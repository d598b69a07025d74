"""Where a report comes from: the code, flights and seeds behind it, and digests of its files.

A chain of digests leads from raw files to pages; `verify_report` computes it again. A bit that the disk has
turned would else become another number or another verdict.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import subprocess
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from wildlab import __version__
from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight.files import flight_name
from wildlab.flight.manifest import FILE_NAME, read_manifest
from wildlab.flight.store import manifest_changed, verify
from wildlab.paths import LOCK, ROOT
from wildlab.reporting.notebook_pages import ALERT
from wildlab.reporting.text import escape, render
from wildlab.runner.seeds import PACKAGES, SeedWork, package_version, read_seed, seed_digest
from wildlab.runner.status import AGAIN, FILES, STATUS, misfits

#: The packages whose version can move a number, or how it is shown.
SHOWN_BY = (*PACKAGES, "matplotlib", "papermill")


def git_state() -> dict[str, Any]:
    """``{"commit": 40 hex digits or None, "dirty": bool or None, "note": "" or why there is none}``.

    Where there is no checkout, the version alone says what the code was.
    """
    nothing = {"commit": None, "dirty": None, "note": "not a git checkout"}
    git = shutil.which("git")
    if ROOT is None or git is None:
        return nothing | {"note": "git is not installed" if ROOT else "installed from a wheel"}

    def ask(*arguments: str) -> str:
        return subprocess.run(  # noqa: S603 - a fixed program, found above, with fixed arguments
            [git, *arguments],
            cwd=ROOT,
            env=os.environ | {"GIT_OPTIONAL_LOCKS": "0"},
            capture_output=True,
            text=True,
            timeout=20,
            check=True,
        ).stdout.strip()

    try:
        top = Path(ask("rev-parse", "--show-toplevel")).resolve()
        # A copy without its history may lie inside somebody else's repository, whose commit says nothing
        # about it.
        if top != ROOT.resolve():
            return nothing
        return {"commit": ask("rev-parse", "HEAD"), "dirty": bool(ask("status", "--porcelain")), "note": ""}
    except (subprocess.SubprocessError, OSError):
        return nothing


def collect(
    *,
    study: str,
    notebook: Path,
    flight: Path | None,
    parameters: dict[str, Any],
    seed: int | None,
    others: Sequence[Path] = (),
) -> dict[str, Any]:
    """Everything ``provenance.json`` says.

    Parameters
    ----------
    flight
        Folder of the flight, or None. Of its manifest only name, kind and how sensitive its locations are
        get in: never the origin.
    parameters
        The study's own parameters, without folders.
    seed
        None where the notebook is given none.
    others
        Folders of further flights, of which the same gets in.
    """
    further = {"others": [provenance_of_flight(other) for other in others]} if others else {}
    return {
        "study": study,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "wildlab": {"version": __version__, **git_state()},
        "lock": {"file": LOCK.name, "sha256": sha256(LOCK) if LOCK.is_file() else None},
        "notebook": {"file": notebook.name, "sha256": sha256(notebook)},
        "flight": provenance_of_flight(flight) if flight is not None else None,
        **further,
        "parameters": parameters,
        "seed": seed,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "packages": {name: found for name in SHOWN_BY if (found := package_version(name)) is not None},
    }


def read_provenance(report: Path) -> dict[str, Any]:
    """What the provenance in a report's folder says; nothing where there is none that can be read."""
    try:
        content = json.loads((report / "provenance.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def provenance_of_flight(folder: Path) -> dict[str, Any]:
    """What provenance says of a flight: its name, its kind, and what its files and raw files are told by.

    Its images are no part of it: they may be a link to gigabytes, and no number comes from them.
    """
    try:
        manifest = tomllib.loads((folder / "flight.toml").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        manifest = {}
    below = (path for path in folder.rglob("*") if not path.is_relative_to(folder / "images"))
    files = sorted(path for path in below if path.is_file() and not path.is_symlink())
    try:
        changed = manifest_changed(folder)
    except WildlabError:
        changed = None
    return {
        "name": flight_name(folder, str(manifest.get("name", folder.name))),
        "manifest_changed": changed,
        "kind": str(manifest.get("kind", "unknown")),
        "locations": str(manifest.get("locations", {}).get("sensitivity", "withheld")),
        "files": {path.relative_to(folder).as_posix(): sha256(path) for path in files},
        "sources": [str(one.get("sha256")) for one in manifest.get("sources", []) if isinstance(one, dict)],
    }


def tables_of(flight: object) -> dict[str, Any]:
    """The digests of a flight's tables by name, of what provenance says of it; its manifest may
    be corrected."""
    files = flight.get("files") if isinstance(flight, dict) else None
    return {name: one for name, one in files.items() if name != FILE_NAME} if isinstance(files, dict) else {}


def same_flight(one: object, other: object) -> bool:
    """Whether two records of provenance are of one flight: its tables are the same."""
    tables = tables_of(one)
    return bool(tables) and tables == tables_of(other)


def flights_near(report: Path, name: str) -> list[Path]:
    """Folders of flights where flights usually are, those called ``name`` first.

    Among those that reports keep, in ``flights`` beside the reports, here and in the checkout, beside the
    report and here.
    """
    bases = (report.resolve().parent, Path.cwd(), *([ROOT] if ROOT is not None else []))
    places = [
        place for base in bases for place in (base / ".flights", base.parent / "flights", base / "flights")
    ] + [place for base in bases[:2] for place in (base, base.parent)]
    found = [one.parent for place in dict.fromkeys(places) for one in sorted(place.glob(f"*/{FILE_NAME}"))]
    return sorted(dict.fromkeys(found), key=lambda folder: folder.name != name)


def flight_of_report(report: Path, theirs: dict[str, Any], again: str) -> Path:
    """The folder of the flight that a report was made from, told by its tables.

    Parameters
    ----------
    report
        The report's folder.
    theirs
        What its provenance says of the flight.
    again
        What to type where it is not found.

    Raises
    ------
    WildlabError
        Where it is in none of the places of `flights_near`.
    """
    name = str(theirs.get("name", ""))
    for folder in flights_near(report, name):
        if same_flight(provenance_of_flight(folder), theirs):
            return folder
    raise WildlabError(
        f"the flight {json.dumps(name)} that this report was made from is not among the flights here, or was "
        "changed since",
        f"say where it is: {again}",
        file=report,
    )


def changed_notice(provenance: dict[str, Any]) -> str:
    """HTML of what a page says where the manifest of a flight is not as it was written; or nothing."""
    flights = [provenance["flight"], *provenance.get("others", ())] if provenance["flight"] else []
    changed = ", ".join(one["name"] for one in flights if one.get("manifest_changed"))
    if not changed:
        return ""
    return (
        f'<section class="alert" data-part="{ALERT}" aria-label="Changed flight.toml"><p><b>flight.toml of '
        f"{escape(changed)} is not as it was written: changed by hand, or damaged.</b> This report uses it "
        "as it is. If the change is meant: <code>wildlab check --accept</code></p></section>"
    )


def footer(
    provenance: dict[str, Any], *, beside: tuple[str, ...] = ("provenance.json", "notebook.ipynb")
) -> str:
    """The provenance in one plain line of HTML for the foot of a page."""
    flights = [provenance["flight"], *provenance.get("others", ())] if provenance["flight"] else []
    made = provenance["made"].replace("T", " ").replace("+00:00", " UTC")
    about = {**provenance, "seeds": provenance.get("seeds"), "made": made, "flights": flights}
    # Names, not links: the page is passed on alone.
    return str(render("provenance", **about, beside=beside))


class Verification(NamedTuple):
    """What became of a report's chain of digests.

    Attributes
    ----------
    misfits
        What does not fit: file, field, problem and fix of each.
    checked
        What was computed again, in words.
    unchecked
        What could not be, and why.
    """

    misfits: tuple[WildlabError, ...]
    checked: tuple[str, ...]
    unchecked: tuple[str, ...]


def verify_report(folder: Path, flight: Path | None = None, raw: Path | None = None) -> Verification:
    """Compute the digests of a report again: of its files, its kept seeds, its flights and their raw files.

    Parameters
    ----------
    folder
        Of the report.
    flight
        Its flight, where that does not lie where flights lie.
    raw
        The folder that the flight was imported from; left out, raw files are not read.

    Raises
    ------
    WildlabError
        Where the folder is no report.
    """
    try:
        status = json.loads((folder / STATUS).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        status = None
    if not isinstance(status, dict):
        raise WildlabError("there is no report that is done here", "name a folder reports/NAME", file=folder)
    if FILES not in status:
        none = WildlabError("the report has no digests", AGAIN, file=folder / STATUS, field=FILES)
        return Verification((none,), (), ())
    found = misfits(folder, status)
    checked = [f"{len(status.get(FILES) or ())} files of the report"]
    unchecked: list[str] = []
    provenance = read_provenance(folder)
    if seeds := provenance.get("seeds"):
        found += _misfits_of_seeds(folder, seeds, checked, unchecked)
    flights = [one for one in (provenance.get("flight"), *provenance.get("others", ())) if one]
    for one in flights:
        where = flight if flight is not None and len(flights) == 1 else _flight_of(folder, one)
        if where is None:
            unchecked.append(f"the flight {one['name']}, which is not found (name it with --flight)")
            continue
        found += _misfits_of_flight(where, one, checked)
        if raw is not None:
            found += _misfits_of_raw(where, raw, checked)
    if flights and raw is None and any(one.get("sources") for one in flights):
        unchecked.append("raw files (name their folder with --raw)")
    return Verification(tuple(found), tuple(checked), tuple(unchecked))


def _misfits_of_seeds(
    folder: Path, seeds: Mapping[str, Any], checked: list[str], unchecked: list[str]
) -> list[WildlabError]:
    digests: dict[str, str] = seeds["digests"]
    work = SeedWork(
        folder.resolve().parent, folder.name, seeds["case"], seeds["parameters"], "", seeds["key"], ()
    )
    found = []
    if hashlib.sha256(json.dumps(digests).encode()).hexdigest() != seeds["digest"]:
        problem = "the digest of all seeds is not that of the digests of each"
        found.append(WildlabError(problem, AGAIN, file=folder / "provenance.json", field="seeds.digest"))
    if not work.folder.is_dir():
        unchecked.append(f"{len(digests)} kept seeds, which are not here any more")
        return found
    for seed, written in digests.items():
        values = read_seed(work, int(seed))
        if values is None or seed_digest(work, int(seed), values) != written:
            problem = "its numbers are not those that the report was made from"
            fix = f"compute the seed again: wildlab run {folder.name}"
            found.append(WildlabError(problem, fix, file=work.folder / f"{seed}.json", field=f"seed {seed}"))
    checked.append(f"{len(digests)} kept seeds")
    return found


def _flight_of(folder: Path, theirs: Mapping[str, Any]) -> Path | None:
    """The flight with these files, or else one of the same name, which was changed."""
    changed = None
    for there in flights_near(folder, theirs["name"]):
        found = provenance_of_flight(there)
        if found["files"] == theirs["files"]:
            return there
        if found["name"] == theirs["name"]:
            changed = changed or there
    return changed


def _misfits_of_flight(folder: Path, theirs: Mapping[str, Any], checked: list[str]) -> Iterator[WildlabError]:
    files, now = theirs["files"], provenance_of_flight(folder)["files"]
    again = "evaluate the flight again, or restore the file"
    for name in sorted({*files, *now}):
        if files.get(name) != now.get(name):
            what = "is missing" if name not in now else "was added" if name not in files else "was changed"
            problem = f"this file {what} since the report was made from the flight"
            yield WildlabError(problem, again, file=folder / name, field=f"flight.files.{name}")
    try:
        verify(folder, read_manifest(folder / FILE_NAME).checksums)
        if manifest_changed(folder):
            problem = "its text is another one than was written: it was changed by hand, or damaged"
            fix = f'if the change is meant: wildlab check --accept "{folder}"; then evaluate it again'
            yield WildlabError(problem, fix, file=folder / FILE_NAME, field=f"checksums.{FILE_NAME}")
    except WildlabError as error:
        yield error
    checked.append(f"{len(files)} files of the flight {theirs['name']}")


def _misfits_of_raw(folder: Path, raw: Path, checked: list[str]) -> Iterator[WildlabError]:
    sources = read_manifest(folder / FILE_NAME).sources
    for one in sources:
        path = raw / one.file
        if not path.is_file():
            fix = "name the folder that the flight was imported from with --raw"
            yield WildlabError("this raw file is missing", fix, file=path, field="sources")
        elif sha256(path) != one.sha256:
            fix = "restore it, or import the flight again"
            yield WildlabError("its SHA-256 is not the one at import", fix, file=path, field="sources")
    checked.append(f"{len(sources)} raw files")
