"""A copy of reports that is safe to send: one file, looked through in memory before it is written."""

from __future__ import annotations

import contextlib
import fcntl
import glob
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import pyzipper
from rich.console import Console

from wildlab.errors import RunFailed, WildlabError
from wildlab.files import write_atomic
from wildlab.flight.manifest import FILE_NAME
from wildlab.flight.store import Flight, confirmed_locations, load_flight
from wildlab.messages.catalogue import Day, Language, load_language, load_texts
from wildlab.paths import REPORTS
from wildlab.runner.catalogue import load_studies
from wildlab.sharing.allow_list import Chapter, first_foreign_word, join_chapters, read_part
from wildlab.sharing.edition import edition_html, facts_of, map_of
from wildlab.sharing.generalisation import Generalised, generalise
from wildlab.sharing.recomputation import (
    RecomputedReports,
    Source,
    describe_agreement,
    flight_folder,
    recompute_reports,
    sources_of,
)
from wildlab.sharing.scan import Secrets, SecretSearch, all_of, flight_secrets, machine_secrets, search_limits
from wildlab.sharing.tiers import (
    Tier,
    Treatment,
    confirmed_treatment,
    describe,
    describe_generalisation,
    describe_place,
    load_tiers,
)

#: Of what the scan found, so many are named.
_MOST = 5
_WORDS = {"public": "for the public", "partner": "for partners", "team": "for the team"}


@dataclass(frozen=True)
class Shared:
    """What was made.

    Attributes
    ----------
    file
        To be sent.
    told
        What was removed, for the sender alone.
    lines
        The same, as lines.
    """

    file: Path
    told: Path
    lines: tuple[str, ...]


class _Prepared(NamedTuple):
    """A flight that is to be drawn again, its generalised copy, and what must not be in the copy."""

    flight: Flight
    made: Generalised
    treatment: Treatment
    secrets: Secrets


class _Document(NamedTuple):
    """What is said of one flight or study: to those who get the copy, and to the sender."""

    name: str
    chapter: Chapter
    told: tuple[str, tuple[str, ...]]
    edition: str = ""


def share(
    report: Path,
    tier: Tier = "public",
    *,
    flight: Path | None = None,
    out: Path | None = None,
    zipped: bool = False,
    password: str | None = None,
    edition: str | Path | None = None,
    overwrite: bool = False,
    reports: Path = REPORTS,
    console: Console | None = None,
) -> Shared:
    """Make a copy of a flight's reports, of a study's, or of all in a folder, that is safe to send.

    Parameters
    ----------
    report
        ``reports/NAME``, its ``report.html``, a folder of reports, or of a flight with reports.
    tier
        For whom.
    flight
        The folder of the flight, where it does not lie where flights lie.
    out
        The file to make; left out, ``<name>-<tier>.html`` (or ``.zip``) here, whose name says nothing.
    zipped
        A zip with a page for each flight and study in place of one page.
    password
        Encrypts; the copy is then a zip.
    edition
        A language, or a file of texts: the flight on one sheet in plain words. In a zip it stands beside the
        reports, otherwise it is the copy.
    overwrite
        Whether a file that is there may be replaced.
    reports, console
        Where reports on a flight's folder are, and where progress is shown.

    Returns
    -------
    Shared

    Raises
    ------
    WildlabError
        Where the report, or its flight, cannot be used.
    RunFailed
        Where a report could not be made again, or has anything that must not be sent: then there is no copy.
    """
    zipped = zipped or password is not None
    if password is not None:
        check_password(password)
    studies = load_studies()
    sources, left_out = sources_of(report, studies, reports)
    if flight is None and (report / FILE_NAME).is_file():
        flight = report
    flights = [source for source in sources if source.logged]
    if flight is not None and len(flights) != 1:
        raise WildlabError("this is not one flight's report", "leave --flight out", field="--flight")
    exact = load_tiers().tier[tier].exact
    words = _language(edition, sources, exact)
    calls = _calls(sources, exact)
    target = _target(calls[0] if len(sources) == 1 else "reports", tier, out, zipped)
    told = target.with_name(f"{target.name}.for-the-sender.txt")
    for file in (target, told):
        refuse_existing(file, overwrite)
    # All are found, and the copy's name is looked through, before the first is computed, which takes minutes.
    folders = [None if exact or not one.logged else flight_folder(one, flight) for one in sources]
    prepared = [
        None if folder is None else _prepare(folder, source, tier, name)
        for source, name, folder in zip(sources, calls, folders, strict=True)
    ]
    secrets = all_of([machine_secrets(), *(one.secrets for one in prepared if one is not None)])
    sought = SecretSearch(secrets)
    _refuse_leaks({target.name: ""}, target, sought)
    documents: list[_Document] = []
    for source, name, one in zip(sources, calls, prepared, strict=True):
        first = 1 + sum(len(document.chapter.parts) for document in documents)
        if one is not None:
            documents.append(_generalised(one, source, tier, first, words, console))
        else:
            documents.append(_copied(source, tier, name, first))
    pages = _pages(documents, target, zipped, len(flights))
    _refuse_leaks(pages, target, sought)
    notes = [*left_out, *search_limits(secrets), *([] if password is None else [describe("encrypted")])]
    lines = sender_list(
        target.name, [document.told for document in documents], notes, generalised=any(folders)
    )
    files = {name: page.encode("utf-8") for name, page in pages.items()}
    put(zip_bytes(files, password) if zipped else files[target.name], target, overwrite)
    put(("\n".join(lines) + "\n").encode("utf-8"), told, overwrite, mode=0o600)
    return Shared(target, told, tuple(lines))


def _calls(sources: Sequence[Source], exact: bool) -> list[str]:
    """What each is called in the copy: flights by number, where their names are not for everybody."""
    flights = [source for source in sources if source.logged]
    names = []
    for source in sources:
        if exact or not source.logged:
            names.append(source.name)
        else:
            names.append("flight" if len(flights) == 1 else f"flight-{flights.index(source) + 1}")
    return names


def _target(name: str, tier: Tier, out: Path | None, zipped: bool) -> Path:
    what, ending = ("a zip", ".zip") if zipped else ("a page", ".html")
    if out is not None and out.suffix.lower() != ending:
        raise WildlabError(
            f"the copy is {what}", f"give it a name that ends in {ending}", file=out, field="--out"
        )
    return Path(f"{name}-{tier}{ending}") if out is None else out


def _pages(documents: Sequence[_Document], target: Path, zipped: bool, flights: int) -> dict[str, str]:
    """The pages by name: one of all, or one of each."""
    if zipped:
        reports = {f"{one.name}.html": join_chapters([one.chapter], one.chapter.heading) for one in documents}
        return reports | {f"{one.name}-one-sheet.html": one.edition for one in documents if one.edition}
    if documents[0].edition:
        return {target.name: documents[0].edition}
    studies = len(documents) - flights
    counts = [(flights, "flight", "flights"), (studies, "study", "studies")]
    said = " and ".join(f"{n} {one if n == 1 else many}" for n, one, many in counts if n)
    return {target.name: join_chapters([one.chapter for one in documents], f"Reports on {said}")}


def _prepare(folder: Path, source: Source, tier: Tier, name: str) -> _Prepared:
    flight = load_flight(folder)
    treatment = confirmed_treatment(flight.manifest.locations, confirmed_locations(folder), tier)
    made = generalise(flight, treatment, name)
    return _Prepared(flight, made, treatment, flight_secrets(flight, made, treatment, source, folder))


def _generalised(
    one: _Prepared,
    source: Source,
    tier: Tier,
    first: int,
    words: Language | None,
    console: Console | None,
) -> _Document:
    """A flight's reports, drawn again."""
    made, treatment, name = one.made, one.treatment, one.made.flight.name
    with private_folder() as work:
        drawn = recompute_reports(one.flight, made, source, work, console=console)
        parts = [
            read_part(folder / "report.html", number, exact=False, generalised=True)
            for number, folder in enumerate(drawn.folders.values(), first)
        ]
    when = f" Flown {'on' if treatment.date == 'day' else 'in'} {made.when}." if made.when else ""
    about = [
        *(describe("missing", what=what) for what in drawn.missing),
        describe("about"),
        describe_agreement(drawn.agreement),
        describe_generalisation(made.cell, treatment.category),
    ]
    heading = f"{'A flight' if name == 'flight' else name.replace('-', ' ').capitalize()}, {_WORDS[tier]}"
    otherwise = drawn.agreement.otherwise
    named = next(filter(None, map(first_foreign_word, otherwise)), "")
    if named:
        raise RunFailed(
            f"there is no copy: it differs from your reports in {named!r}, which it cannot say",
            "evaluate the flight again and share that",
            file=source.folders[0],
        )
    if words is not None and otherwise:
        raise RunFailed(
            f"the sheet would not say what your reports say: {' '.join(otherwise).rstrip('.')}",
            "share the reports without --edition",
            file=source.folders[0],
        )
    lead = " ".join(
        [*([describe("beware"), *otherwise] if otherwise else []), describe_place(made.cell) + when]
    )
    chapter = Chapter(heading, lead, tuple(filter(None, about)), tuple(parts))
    sheet = "" if words is None else _sheet(drawn, name, treatment, words)
    return _Document(name, chapter, (f"Flight {source.name}", tuple(_told(drawn, treatment))), sheet)


def _sheet(drawn: RecomputedReports, name: str, treatment: Treatment, words: Language) -> str:
    """The flight on one sheet, from its generalised copy alone."""
    made = drawn.made
    epoch = made.flight.manifest.time.epoch
    day = None if epoch is None else Day(epoch.date(), treatment.date == "day")
    return edition_html(
        facts_of(drawn.own), name=name, place=made.cell, day=day, picture=map_of(made.flight), language=words
    )


def _language(edition: str | Path | None, sources: Sequence[Source], exact: bool) -> Language | None:
    """The texts of the sheet, where one is asked for."""
    if edition is None:
        return None
    if exact or len(sources) != 1 or not sources[0].logged:
        raise WildlabError(
            "the sheet is of one flight, for partners or the public",
            "name one report on a flight",
            field="--edition",
        )
    return load_language(edition)


def _told(drawn: RecomputedReports, treatment: Treatment) -> Iterator[str]:
    how = "stated" if treatment.stated else "assumed"
    how = how if treatment.unconfirmed is None else "unconfirmed"
    values = {"category": treatment.category, "date": treatment.date, "other": treatment.unconfirmed}
    yield describe(f"category-{how}", **values)
    yield from drawn.made.removed
    a = drawn.agreement
    if a.compared:
        yield describe("same-numbers", same=a.same, compared=a.compared)
    if a.which:
        yield describe("worst-number", worst=f"{a.worst:.2g}", which=a.which)
    yield from a.otherwise
    yield from drawn.notes


def _copied(source: Source, tier: Tier, name: str, first: int) -> _Document:
    """A study's reports, or a flight's for those who have it, as they are."""
    exact = load_tiers().tier[tier].exact
    parts = [
        read_part(one / "report.html", number, exact=exact, generalised=False)
        for number, one in enumerate(source.folders, first)
    ]
    about = describe("team" if source.logged else "nobody")
    heading = f"{'Flight' if source.logged else 'Study'} {source.name}"
    return _Document(
        name, Chapter(f"{name}, {_WORDS[tier]}", about, (), tuple(parts)), (heading, (describe("removed"),))
    )


def _refuse_leaks(pages: Mapping[str, str], target: Path, sought: SecretSearch) -> None:
    """Look through all that is to be sent, and refuse it where something must not be in it.

    Raises
    ------
    RunFailed
        Naming what was found, and where.
    """
    found = sought.scan(pages)
    if not found:
        return
    several = "; ".join(f"{one} {one.word and f'({one.word})'} in {one.found!r}" for one in found[:_MOST])
    more = f"; and {len(found) - _MOST} more" if len(found) > _MOST else ""
    named = all(one.file.startswith("the name of the file") for one in found)
    raise RunFailed(
        f"there is no copy: this was found in it: {several}{more}",
        "give the copy another name: --out FILE"
        if named
        else "rename it there, evaluate and share again; report a place or date",
        file=target,
        field="--out" if named else "",
    )


def sender_list(
    file: str, told: Sequence[tuple[str, Sequence[str]]], notes: Sequence[str], *, generalised: bool
) -> list[str]:
    """The whole list.

    Parameters
    ----------
    file
        Name of the copy.
    told
        Heading and lines for each flight and study.
    notes
        Sentences on the copy as a whole.
    generalised
        Whether there is a place to be hidden in it.

    Returns
    -------
    list of str
    """
    lines = [describe("for-the-sender", file=file), ""]
    for heading, ones in told:
        lines += [heading, *(f"  {line}" for line in ones), ""]
    if generalised:
        texts = load_texts("sharing").answers
        remains = [text for key, text in texts.items() if key.startswith("remains-")]
        lines += [describe("cannot-hide"), *(f"  {line}" for line in remains), ""]
    if notes:
        lines += ["Also", *(f"  {line}" for line in notes), ""]
    return lines[:-1]


#: Of every file in a zip: no zip can be older, and this one says nothing of when it was made.
_TIME = (1980, 1, 1, 0, 0, 0)
#: A password is tried offline, as often as whoever has the file can pay for.
SHORTEST = 12


#: How the name of a `private_folder` begins, and the file in it that says it is one.
_PREFIX, _MARK = "wildlab-share-", ".wildlab-private"
#: How the name of a file ends that is written and not finished, see `wildlab.files.write_atomic`.
_PART = re.compile(r"\.[a-z0-9_]{8}")
#: Waits until the process that started it is gone, however it ended, and removes a folder until it stays
#: away: what that process had started may still write into it.
_WATCH = """
import os, shutil, sys, time
sys.stdin.buffer.read()
for _ in range(20):
    if not os.path.lexists(sys.argv[1]):
        break
    shutil.rmtree(sys.argv[1], ignore_errors=True)
    time.sleep(0.25)
"""


@contextlib.contextmanager
def private_folder() -> Iterator[Path]:
    """A folder among the system's temporary ones that nobody else may open; gone afterwards, however it ends.

    A process of its own watches over it, so that nothing is left where this one is killed. Those that a
    machine has left when it stopped go first: they carry our mark, and nobody holds their lock any more.
    """
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*/{_MARK}"):
        with contextlib.suppress(OSError), _held(left.parent):
            shutil.rmtree(left.parent, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=_PREFIX) as folder, _held(Path(folder)):
        (Path(folder) / _MARK).touch()  # not before the lock is held
        command = [sys.executable, "-I", "-S", "-c", _WATCH, folder]
        watch = subprocess.Popen(  # noqa: S603 - our own words
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True, cwd=tempfile.gettempdir(),
        )  # fmt: skip
        try:
            yield Path(folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            watch.communicate()


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold a folder's lock, which ends with this process, however that ends; OSError where another has it."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def refuse_existing(target: Path, overwrite: bool) -> None:
    """Nothing is overwritten without being asked; and what nothing can be written into is no place.

    Raises
    ------
    WildlabError
        Where there is something that may not be replaced, or no folder that can be written to.
    """
    folder = next(one for one in target.absolute().parents if os.path.lexists(one))
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise WildlabError("nothing can be written here", "use --out", file=folder)
    if target.is_dir():
        raise WildlabError("is a folder, and a copy is one file", "use --out", file=target)
    if os.path.lexists(target) and not overwrite:
        fix = "use --out or --overwrite"
        raise WildlabError("this file is there already", fix, file=target)


def check_password(password: str) -> None:
    """Refuse a password that could be tried out.

    Raises
    ------
    WildlabError
        Where it is too short.
    """
    if len(password) < SHORTEST:
        raise WildlabError(
            f"the password has {len(password)} characters, which can all be tried",
            f"take {SHORTEST} or more",
        )


def zip_bytes(files: Mapping[str, bytes], password: str | None = None) -> bytes:
    """Files as a zip, which lies nowhere yet; the same files without a password give the same bytes.

    Parameters
    ----------
    files
        Content by name.
    password
        With it, what is inside is encrypted with AES-256; the names are not.
    """
    whole = io.BytesIO()
    with pyzipper.AESZipFile(whole, "w", compression=pyzipper.ZIP_DEFLATED) as zipped:
        if password is not None:
            zipped.setpassword(password.encode("utf-8"))
            # Version 2: the first one writes a checksum of what is inside where everybody can read it.
            zipped.setencryption(pyzipper.WZ_AES, nbits=256, force_wz_aes_version=2)
        for name, content in files.items():
            info = pyzipper.zipfile_aes.AESZipInfo(name, date_time=_TIME)
            info.compress_type = pyzipper.ZIP_DEFLATED
            info.create_system, info.external_attr = 3, 0o644 << 16
            zipped.writestr(info, content)
    return whole.getvalue()


#: Nobody writes longer than that on a copy (s).
LEFT_S = 3600.0


def put(content: bytes, target: Path, overwrite: bool, mode: int = 0o644) -> None:
    """Write a finished file, whole or not at all; half of one that a machine left when it stopped goes, after
    an hour: before, another copy may be writing it.

    Raises
    ------
    WildlabError
        Where something came into its place meanwhile.
    """
    refuse_existing(target, overwrite)
    target.parent.mkdir(parents=True, exist_ok=True)
    for part in target.parent.glob(f".{glob.escape(target.name)}.????????"):
        with contextlib.suppress(FileNotFoundError):
            left = time.time() - part.lstat().st_mtime > LEFT_S
            if left and _PART.fullmatch(part.suffix) and part.is_file() and not part.is_symlink():
                part.unlink()
    write_atomic(target, content, mode)
