"""Which reports are meant, what each was made from, and where the flight lies that it was made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.flight.manifest import FILE_NAME, read_manifest
from wildlab.paths import REPORTS
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.evaluate import MANY_NOTEBOOK
from wildlab.runner.job import typed
from wildlab.runner.ledger import ABOUT
from wildlab.runner.provenance import (
    flight_of_report,
    flights_near,
    provenance_of_flight,
    read_provenance,
    same_flight,
)
from wildlab.runner.status import BEFORE_DIGESTS, has_digests, read_status
from wildlab.simulation.parameters import load_twin, twin_names

#: What the names of the reports on a flight end in, in the order in which they are read.
ENDS = tuple(sorted(ABOUT, key=("-overview", "", "-navigation", "-tracking", "-many").index))
#: Of the one that `wildlab track --many` makes; `wildlab evaluate` makes the others.
MANY = "-many"


@dataclass(frozen=True)
class Source:
    """One flight with its reports, or one study.

    Attributes
    ----------
    name
        Of the flight or the study.
    folders
        Of its reports that are done, in order.
    logged
        Whether it is a flight whose place and date are somebody's: its reports are drawn again.
    flight
        What provenance says of the flight.
    parameters
        By the name of the report's folder.
    """

    name: str
    folders: tuple[Path, ...]
    logged: bool
    flight: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)


def sources_of(
    path: Path, studies: dict[str, StudyEntry], reports: Path = REPORTS
) -> tuple[list[Source], list[str]]:
    """What a report's folder, or a folder of reports, is made from.

    Parameters
    ----------
    path
        ``reports/NAME``, its ``report.html``, ``reports``, or the folder of a flight.
    studies
        By name.
    reports
        Where those of a flight's folder are.

    Returns
    -------
    sources : list of Source
        Of a single report on a flight, with all of the flight's reports.
    left_out : list of str
        Sentences, on reports that do not go along: they cannot be shared, or are of other tables.

    Raises
    ------
    WildlabError
        Where there is no report, or the one that is meant cannot be shared, with the reason.
    """
    if (path / FILE_NAME).is_file():
        mine = provenance_of_flight(path)
        ours = [
            one
            for one in _made(reports, mine["name"])
            if same_flight(read_provenance(one).get("flight") or {}, mine)
        ]
        if not ours:
            raise WildlabError(
                f"there is no report on this flight as it is in {reports.resolve()}",
                f"evaluate it: {typed('wildlab evaluate', path)}",
                file=path,
            )
        path = ours[0]
    folder = path.parent if path.name == "report.html" else path
    if not folder.is_dir():
        fix = "name the folder of a report, or of all of them"
        raise WildlabError("there is no such report", fix, file=path)
    if (folder / "report.html").is_file():
        source, left_out = _with_siblings(_source(folder, studies), studies)
        return [source], left_out
    found: dict[str, Source] = {}
    single: list[Source] = []
    left_out = []
    for one in sorted(folder.iterdir()):
        if one.name.startswith(".") or not (one / "report.html").is_file():
            continue
        try:
            single.append(_source(one, studies))
        except WildlabError as error:
            left_out.append(str(error))
    # The flight as it was evaluated is the one that is meant; targets may have been followed before that.
    for source in sorted(single, key=lambda one: one.folders[0].name == f"{one.name}{MANY}"):
        if source.name not in found:
            found[source.name], more = _with_siblings(source, studies)
            left_out += more
    if not found:
        why = f" ({left_out[0]})" if left_out else ""
        raise WildlabError(f"no report here can be shared{why}", "name a folder with others", file=path)
    return list(found.values()), list(dict.fromkeys(left_out))


def _source(folder: Path, studies: dict[str, StudyEntry]) -> Source:
    status = read_status(folder)
    if status.get("state") == "damaged":
        raise WildlabError(str(status["reason"]), "make the report again", file=folder)
    if status.get("state") != "done":
        raise WildlabError("this report is not done", "make it again", file=folder)
    provenance = read_provenance(folder)
    if not provenance:
        fix = "evaluate the flight, and share what that makes"
        raise WildlabError("nothing says what this report was made from", fix, file=folder)
    flight = provenance.get("flight")
    given = provenance.get("parameters")
    parameters = {folder.name: given if isinstance(given, dict) else {}}
    entry = studies.get(folder.name)
    # Of the catalogue: everybody has the data.
    public = entry is not None and (entry.dataset is not None or entry.twin is not None)
    if not isinstance(flight, dict) or public or (entry is not None and of_a_study(flight, folder.parent)):
        return Source(folder.name, (folder,), False, {}, parameters)
    name = str(flight.get("name", ""))
    if not _drawn_again(folder, name, provenance):
        raise WildlabError(
            "this report cannot be drawn again from generalised data",
            "evaluate the flight, and share what that makes",
            file=folder,
        )
    return Source(name, (folder,), True, flight, parameters)


def _drawn_again(folder: Path, name: str, provenance: Mapping[str, Any]) -> bool:
    """Whether a report is one that is made again from the flight of this name.

    What is called like that on many targets may be another one: `wildlab track` leaves its own where it is
    told to.
    """
    if folder.name not in {f"{name}{end}" for end in ABOUT}:
        return False
    notebook = provenance.get("notebook")
    file = notebook.get("file") if isinstance(notebook, dict) else None
    return folder.name != f"{name}{MANY}" or file == MANY_NOTEBOOK


def _made(reports: Path, name: str) -> list[Path]:
    """The reports that there are on a flight of this name, are made again, and are done."""
    found = [reports / f"{name}{end}" for end in ENDS]
    found = [one for one in found if _drawn_again(one, name, read_provenance(one))]
    return [
        one for one in found if (one / "report.html").is_file() and read_status(one).get("state") == "done"
    ]


def of_a_study(flight: dict[str, Any], reports: Path) -> bool:
    """Whether it is a twin that comes with wildlab, whose place everybody knows.

    Any other twin is somebody's: its place may be a true one, and so is its name.
    """
    name = str(flight.get("name", ""))
    twin = name.rpartition("-")[0]
    if flight.get("kind") != "twin" or twin not in twin_names():
        return False
    place = load_twin(twin).place
    packaged = (place.latitude.number, place.longitude.number)
    for folder in flights_near(reports / name, name):
        try:
            manifest = read_manifest(folder / FILE_NAME)
        except WildlabError:
            continue
        # Of one that is called so and lies elsewhere, it may be the one that is meant.
        if (
            name in (folder.name, manifest.name)
            and (manifest.origin.latitude_deg, manifest.origin.longitude_deg) != packaged
        ):
            return False
    return True


def _with_siblings(source: Source, studies: dict[str, StudyEntry]) -> tuple[Source, list[str]]:
    """All reports on the flight beside one, in their usual order; and sentences on those of its name that do
    not go along, since they are of other tables or not as they were written, and on those that nothing tells
    it of."""
    if not source.logged:
        return source, []
    reports = source.folders[0].parent
    folders: list[Path] = []
    parameters: dict[str, dict[str, Any]] = {}
    left_out = []
    for folder in (reports / f"{source.name}{end}" for end in ENDS):
        if not (folder / "report.html").is_file():
            continue
        try:
            one = _source(folder, studies)
        except WildlabError as error:
            left_out += [str(error)] if read_status(folder).get("state") == "damaged" else []
            continue
        if not one.logged or one.name != source.name:
            continue
        if same_flight(one.flight, source.flight):
            folders.append(folder)
            parameters |= one.parameters
        else:
            left_out.append(f"{folder}: it was made from other tables.")
    old = ", ".join(folder.name for folder in folders if not has_digests(read_status(folder)))
    left_out += [f"{old}: {BEFORE_DIGESTS}."] if old else []
    return Source(source.name, tuple(folders), True, source.flight, parameters), left_out


def flight_folder(source: Source, given: Path | None) -> Path:
    """The flight that reports were made from: the one that is given, or one that lies where flights lie.

    Parameters
    ----------
    source
        With what provenance says.
    given
        What the user names, if anything.

    Returns
    -------
    Path

    Raises
    ------
    WildlabError
        Where none is found, or the one given is another, with what to type.
    """
    again = f"{typed('wildlab share', source.folders[0])} --flight FOLDER"
    if given is not None:
        if not (given / FILE_NAME).is_file():
            raise WildlabError("there is no flight in this folder", "name its folder", file=given)
        if not same_flight(provenance_of_flight(given), source.flight):
            raise WildlabError(
                f"this is not the flight that the reports on {source.name} were made from",
                f"evaluate it again, or: {again}",
                file=given,
                field="--flight",
            )
        return given
    return flight_of_report(source.folders[0], source.flight, again)
