"""A replay of a flight folder, or of the flight that a report was made from: files in, files out."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pandas as pd
from rich.console import Console

from wildlab.analysis.tracks.tracker import read_estimates
from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.manifest import FILE_NAME
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import REPORTS
from wildlab.replay.images import images_of, read_shots
from wildlab.replay.page import page
from wildlab.replay.recording import save_recording
from wildlab.replay.scene import ReplayScene, scene_of
from wildlab.runner.evaluate import tell_source
from wildlab.runner.provenance import flight_of_report, provenance_of_flight, read_provenance

PAGE, RECORDING, ESTIMATES = "replay.html", "replay.rrd", "estimates.parquet"


def replay(
    folder: Path,
    *,
    into: Path | None = None,
    images: Path | None = None,
    source: str | None = None,
    reports: Path = REPORTS,
    console: Console | None = None,
) -> tuple[list[Path], ReplayScene]:
    """Write the replay of a flight: a page, and a recording for rerun's viewer.

    Parameters
    ----------
    folder
        A flight folder, or a report's whose flight can be found.
    into
        Where to; left out, the report's own folder, or ``<reports>/<name of the flight>-replay``.
    images
        A folder of the flight's images, or a video; left out, ``images`` in the flight folder where that is.
    source
        Name of the ``nav`` table; left out, the best of `Flight.estimated_sources`.
    reports
        Where reports are: tracks of the flight are looked for there.
    console
        Where progress is shown.

    Returns
    -------
    files, scene
        What was written, and what it shows.

    Raises
    ------
    WildlabError
        Where there is no such flight, or nothing to show.
    """
    report = None if (folder / FILE_NAME).exists() else folder
    place = folder if report is None else flight_of(folder)
    flight = load_flight(place)
    with nullcontext() if console is None else console.status("reading the flight") as status:

        def tell(what: str) -> None:
            if status is not None:
                status.update(what)

        tell_source(flight, source, console)
        scene = scene_of(flight, source, estimates_of(flight, report, reports))
        scene, shots = _with_images(scene, place, images, tell)
        target = into or report or reports / f"{flight.name}-replay"
        if target.resolve() == place.resolve():
            raise WildlabError(
                "a replay is no part of a flight",
                "name another folder with --out",
                file=target,
                field="--out",
            )
        target.mkdir(parents=True, exist_ok=True)
        tell("writing")
        write_atomic(target / PAGE, page(scene, shots))
        save_recording(scene, target / RECORDING, shots)
    return [target / PAGE, target / RECORDING], scene


def _with_images(
    scene: ReplayScene, flight: Path, images: Path | None, tell: Callable[[str], None]
) -> tuple[ReplayScene, dict[int, bytes]]:
    place = images or images_of(flight)
    if scene.views is None:
        return scene, {}
    if place is None:
        lacks = "pictures: they are not in the flight folder; --images names where they are"
        return replace(scene, lacks=(*scene.lacks, lacks)), {}
    size = None if scene.camera is None else (scene.camera.width, scene.camera.height)
    seen = set() if scene.sightings is None else set(scene.sightings.frame.tolist())
    ids = list(scene.views.ids)
    found = read_shots(place, ids, size, seen, lambda done, of: tell(f"reducing images: {done} of {of}"))
    return replace(scene, lacks=(*scene.lacks, *found.lacks)), found.by_row


def estimates_of(flight: Flight, report: Path | None, reports: Path) -> pd.DataFrame | None:
    """Tracks of a flight: those of the report that was named, else of its report on tracks, if there is one.

    Returns
    -------
    DataFrame or None
        None where there are none, or those there are of another flight of the same name.

    Raises
    ------
    WildlabError
        Where the table cannot be read or lacks a column.
    """
    if flight.folder is None:
        return None
    names = [flight.name, f"{flight.name}-tracking"]
    beside = reports if report is None else report.resolve().parent
    files = provenance_of_flight(flight.folder)["files"]
    for one in ([report] if report is not None else []) + [beside / name for name in names[1:]]:
        theirs = read_provenance(one).get("flight")
        if (one / ESTIMATES).is_file() and isinstance(theirs, dict) and theirs.get("files") == files:
            return read_estimates(one / ESTIMATES)
    return None


def flight_of(report: Path) -> Path:
    """The folder of the flight that a report was made from (`flight_of_report`).

    Raises
    ------
    WildlabError
        Where the folder is no report, says of no flight, or that flight is not found.
    """
    if not report.is_dir():
        raise WildlabError("there is no such folder", "name a flight folder, or a report's", file=report)
    theirs = read_provenance(report).get("flight")
    if not isinstance(theirs, dict) or not isinstance(theirs.get("files"), dict) or not theirs["files"]:
        raise WildlabError(
            "this is neither a flight folder (it has no flight.toml) nor the report of a flight",
            "name the folder of a flight: wildlab replay flights/mine",
            file=report,
        )
    return flight_of_report(report, theirs, "wildlab replay flights/mine --out REPORT")
