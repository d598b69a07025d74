"""The reports of a copy, computed again from the generalised flight."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from wildlab.errors import RunFailed, WildlabError
from wildlab.files import write_atomic
from wildlab.flight.calibration_files import Learnt, parse_learnt, read_learnt, write_calibration
from wildlab.flight.files import dump_toml
from wildlab.flight.manifest import parse_settings
from wildlab.flight.store import CALIBRATION, Flight, save_flight
from wildlab.paths import NOTEBOOKS
from wildlab.reporting.own_flights import OwnFlight
from wildlab.runner.evaluate import evaluate_flight
from wildlab.runner.processes.scheduling import Outcome
from wildlab.runner.record.own_flights import ABOUT, own_flights
from wildlab.runner.track import track_many
from wildlab.sharing.generalisation import Generalised, neutral_learnt
from wildlab.sharing.names import neutral_settings
from wildlab.sharing.reports import ENDS, MANY, Source
from wildlab.sharing.sender_list import Agreement, compare

#: What `wildlab evaluate` does not set of these, `wildlab track` was told.
_TOLD = ("filters", "targets", "sensors", "settings", "tuned", "smooth")


class RecomputedReports(NamedTuple):
    """A generalised flight and its reports.

    Attributes
    ----------
    made
        The flight, and what was taken out of it.
    folders
        Of the reports, by the end of their name (`ENDS`), in order.
    own
        The flight with its reports, as the edition takes it.
    agreement
        With the sender's own reports.
    notes
        Sentences for the sender.
    missing
        What no report could be made on, in words of the report.
    """

    made: Generalised
    folders: dict[str, Path]
    own: OwnFlight
    agreement: Agreement
    notes: tuple[str, ...]
    missing: tuple[str, ...]


def recompute_reports(
    flight: Flight,
    made: Generalised,
    source: Source,
    work: Path,
    *,
    notebooks: Path = NOTEBOOKS,
    console: Console | None = None,
) -> RecomputedReports:
    """Make the reports of a flight again from its generalised copy.

    Parameters
    ----------
    flight, made
        The true one, from its folder, and its generalised copy.
    source
        Its reports here, whose parameters are used again.
    work
        A folder to work in, which is gone afterwards.
    notebooks, console
        As for `evaluate_flight`.

    Returns
    -------
    Redrawn

    Raises
    ------
    RunFailed
        Where a report could not be made again that is done here.
    """
    name = made.flight.name
    copy, reports = work / name, work / "reports"
    kept = None if flight.calibration is None else neutral_learnt(read_learnt(flight.calibration), made)
    save_flight(made.flight, copy, calibration=kept)
    told = _told(source, made)
    learnt: Learnt | None = told["calibration"]
    applied = None
    if learnt is not None and not (kept is not None and learnt == kept):
        applied = work / CALIBRATION
        write_calibration(learnt, applied)
    outcomes = evaluate_flight(
        copy,
        source=told["source"],
        calibration=applied,
        reports=reports,
        notebooks=notebooks,
        console=console,
    )
    done = {one.name for one in source.folders}
    several = f"{source.name}{MANY}" in done
    if several:
        outcome, more = _many(copy, made, source, work, reports, notebooks, console)
        outcomes = [*outcomes, outcome]
        told["notes"] += more
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    for outcome in failed:
        if f"{source.name}{outcome.name.removeprefix(name)}" in done:
            why = outcome.reason.rstrip(".")
            raise RunFailed(
                f"the report {outcome.name} could not be made from generalised data ({why})",
                "check the flight: wildlab check; then evaluate it and share it again",
                file=flight.folder,
            )
    wanted = [end for end in ENDS if end != MANY or several]
    ends = [end for end in wanted if f"{name}{end}" not in {outcome.name for outcome in failed}]
    folders = {
        end: reports / f"{name}{end}" for end in ends if (reports / f"{name}{end}" / "report.html").is_file()
    }
    mine = {one.name: one for one in source.folders}
    pairs = {
        mine[f"{source.name}{end}"]: there for end, there in folders.items() if f"{source.name}{end}" in mine
    }
    lost = [one for one in mine if mine[one] not in pairs]
    notes = told["notes"] + [f"There is no counterpart of your report {one} in the copy." for one in lost]
    missing = tuple(ABOUT[end] for end in wanted if end not in ends)
    notes += [f"There is no report on {one} in the copy, as there is none here." for one in missing]
    (own,) = own_flights(reports, ())
    numbered = [one for one in pairs if one.name == f"{source.name}{MANY}"]
    agreement = compare(pairs, made.names, numbered)
    return RecomputedReports(made, folders, own, agreement, tuple(notes), missing)


def _many(
    copy: Path,
    made: Generalised,
    source: Source,
    work: Path,
    reports: Path,
    notebooks: Path,
    console: Console | None,
) -> tuple[Outcome, list[str]]:
    """The report on many targets, told what the sender's was told; and notes for the sender."""
    given = source.parameters.get(f"{source.name}{MANY}", {})
    named = f"{made.flight.manifest.name}{MANY}"
    notes = []
    try:
        text, file = str(given.get("settings") or ""), None
        if text:
            told, left_out = neutral_settings(parse_settings(text), made.names, made.clocks, made.pixels)
            file = work / "settings.toml"
            write_atomic(file, dump_toml(told.model_dump(exclude_none=True)))
            notes = [
                f"The settings of your report {source.name}{MANY} speak of {one!r}, which the flight does "
                "not have: those of the copy do not."
                for one in left_out
            ]
        sensors = given.get("sensors") or ()
        poses = given.get("source")
        outcome = track_many(
            copy,
            sensors=[made.names.of("sensor", str(one)) for one in sensors],
            settings=file,
            source=made.names.of("poses", str(poses)) if poses else None,
            reports=reports,
            notebooks=notebooks,
            console=console,
        )
    except WildlabError as error:
        raise RunFailed(
            f"the report {named} could not be made from generalised data ({error.problem.rstrip('.')})",
            error.fix,
            file=source.folders[0].with_name(f"{source.name}{MANY}"),
            field=error.field,
        ) from None
    return outcome, notes


def _told(source: Source, made: Generalised) -> dict[str, Any]:
    """What the sender's reports were told, in the copy's names."""
    given: Mapping[str, Any] = {}
    notes = []
    for end in ENDS:
        if end == MANY and len(source.folders) > 1:
            # What it was told says nothing of what the others were told.
            continue
        parameters = source.parameters.get(f"{source.name}{end}", {})
        given = {**{key: value for key, value in parameters.items() if value}, **given}
        if end == "-tracking" and any(parameters.get(key) for key in _TOLD):
            notes.append(
                "The report on tracking was made by `wildlab track` with settings of its own; that in the "
                "copy is the one that `wildlab evaluate` makes."
            )
    poses, calibration = given.get("source"), given.get("calibration")
    return {
        "source": made.names.of("poses", str(poses)) if poses else None,
        "calibration": neutral_learnt(parse_learnt(str(calibration)), made) if calibration else None,
        "notes": notes,
    }
