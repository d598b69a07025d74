"""A flight on disk: one folder with `flight.toml` and Parquet tables, and their checksums in it.

A byte that changed by itself is found on load. The part ``[checksums]`` is the last of the file, and has one
of the text above it too. Whoever changes something on purpose writes the part anew with `accept_changes`
(``wildlab check --accept``); the rest of the file, comments too, stays as it is. A changed table is refused;
a changed `flight.toml` is used and said, since that is where a flight is corrected by hand.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import re
import shutil
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet

from wildlab.errors import WildlabError
from wildlab.files import sha256, write_atomic
from wildlab.flight.calibration_files import Learnt, write_calibration
from wildlab.flight.files import (
    SAFE,
    TOML_LIMIT,
    dump_toml,
    flight_name,
    gdal,
    inside,
    is_safe_name,
    parse_toml,
    printable,
    read_regular,
    regular_size,
)
from wildlab.flight.manifest import (
    FILE_NAME,
    LocationsPart,
    Manifest,
    Sensitivity,
    manifest_toml,
    read_manifest,
)
from wildlab.flight.schema import NAV, TABLES, Table, conform
from wildlab.geometry.frames import Indices
from wildlab.geometry.georeference import Terrain
from wildlab.summary_table import Brief, Summary

TERRAIN = "terrain.tif"
#: What was learnt on another flight, where this one came with it.
CALIBRATION = "calibration.toml"
#: The part of `flight.toml`, and its line.
PART = "checksums"
#: The part on how sensitive places are: stated by hand whenever that is known, so its change is no damage. It
#: has a checksum of its own, of what was confirmed last.
STATED = "locations"
_HEADERS = {part: re.compile(rf"^[ \t]*\[[ \t]*{part}[ \t]*\].*$", re.MULTILINE) for part in (PART, STATED)}
_NEXT = re.compile(r"^[ \t]*\[", re.MULTILINE)
MISSING, RESTORE = "this file is missing", "restore it, or import again"


def table_files(folder: Path) -> dict[str, Path]:
    """Tables, terrain and calibration of a flight folder, by their names in it: ``"nav/logged.parquet"``."""
    names = [f"{name}.parquet" for name in TABLES] + [TERRAIN, CALIBRATION]
    names += sorted(f"nav/{path.name}" for path in (folder / "nav").glob("*.parquet"))
    return {name: folder / name for name in names if (folder / name).is_file()}


def checksums_of(folder: Path) -> dict[str, str]:
    """SHA-256 of every table of a flight folder.

    Parameters
    ----------
    folder
        The flight folder.

    Returns
    -------
    dict
        64 hexadecimal digits by the file's name in the folder.

    Raises
    ------
    WildlabError
        Where a table is a link out of the folder.
    """
    return {
        name: sha256(inside(folder, name, file=folder, field=name)) for name in sorted(table_files(folder))
    }


def verify(folder: Path, stated: Mapping[str, str]) -> None:
    """Hold every table against its checksum. Without any checksums there is nothing to hold it against.

    Parameters
    ----------
    folder
        The flight folder.
    stated
        The checksums that `flight.toml` states.

    Raises
    ------
    WildlabError
        Naming the first table that is missing, was added or was changed.
    """
    if not stated:
        return
    meant = f'if it is meant: wildlab check --accept "{folder}"'
    found = checksums_of(folder)
    for name in sorted({*stated, *found} - {FILE_NAME, STATED}):
        if found.get(name) == stated.get(name):
            continue
        problem, remedy = "its SHA-256 is not that in flight.toml: it was damaged or changed", RESTORE
        if name not in found:
            problem = MISSING
        elif name not in stated:
            problem, remedy = "it has no checksum in flight.toml: it was added later", "move it elsewhere"
        raise WildlabError(problem, f"{remedy}; {meant}", file=folder / name)


def accept_changes(folder: Path) -> list[str]:
    """Write the checksums of the tables as they are into `flight.toml`.

    Parameters
    ----------
    folder
        The flight folder.

    Returns
    -------
    list of str
        The tables whose checksum is another one now, were added or are gone.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read, or no part can be told in it.
    """
    path = inside(folder, FILE_NAME, file=folder, field=FILE_NAME)
    before, tables = read_manifest(path).checksums, checksums_of(folder)
    text = _text(path)
    now = tables | {FILE_NAME: _of_text(text), STATED: _of_places(read_manifest(path).locations)}
    changed = [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]
    if changed:
        new = with_checksums(text, tables)
        # What looks like the part may stand inside of a text of several lines.
        if parse_toml(new, path) | {PART: None} != parse_toml(text, path) | {PART: None}:
            problem = "a text in it has a line that reads [checksums]"
            raise WildlabError(problem, "reword that line", file=path, field=PART)
        write_atomic(path, new)
    return changed


def manifest_changed(folder: Path) -> bool | None:
    """Whether `flight.toml`, but for its part ``[locations]``, is another text than the one that was written;
    None where that cannot be told.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read.
    """
    path = inside(folder, FILE_NAME, file=folder, field=FILE_NAME)
    stated = read_manifest(path).checksums.get(FILE_NAME)
    text = _text(path)
    return None if stated is None else stated != _of_text(text)


def confirmed_locations(folder: Path) -> LocationsPart:
    """How sensitive the places of a flight are by what was written or accepted last.

    Only its checksum is kept, and every ``[locations]`` that there can be is held against it; where none
    fits, or there is no checksum, nothing was confirmed and places are withheld.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read.
    """
    stated = read_manifest(inside(folder, FILE_NAME, file=folder, field=FILE_NAME)).checksums.get(STATED)
    categories = (None, 1, 2, 3, 4)
    every = (
        LocationsPart(sensitivity=sensitivity, category=own, agreed_category=agreed)
        for sensitivity, own, agreed in product(get_args(Sensitivity), categories, categories)
    )
    return next((one for one in every if _of_places(one) == stated), LocationsPart())


def locations_confirmed(folder: Path) -> bool:
    """Whether ``[locations]`` is as it was written or accepted last; true of a flight without that checksum
    that states nothing.

    Raises
    ------
    WildlabError
        Where `flight.toml` cannot be read.
    """
    manifest = read_manifest(inside(folder, FILE_NAME, file=folder, field=FILE_NAME))
    return manifest.checksums.get(STATED, _of_places(LocationsPart())) == _of_places(manifest.locations)


def _of_places(locations: LocationsPart) -> str:
    return hashlib.sha256(locations.model_dump_json().encode()).hexdigest()


def _text(path: Path) -> str:
    return read_regular(path, TOML_LIMIT).decode("utf-8")


def _of_text(text: str) -> str:
    """SHA-256 of a manifest's text but for the checksums and what is `STATED` of places."""
    return hashlib.sha256(_without(_without(text), STATED).encode("utf-8")).hexdigest()


def _without(text: str, part: str = PART) -> str:
    header = _HEADERS[part].search(text)
    if header is not None:
        rest = _NEXT.search(text, header.end())
        text = text[: header.start()] + (text[rest.start() :] if rest is not None else "")
    return text.rstrip("\n") + "\n"


def with_checksums(text: str, tables: Mapping[str, str]) -> str:
    """The text of a `flight.toml` with these checksums and its own as the last part, and no others.

    Parameters
    ----------
    text
        Of the file.
    tables
        The checksums of the tables, by file name.

    Returns
    -------
    str

    Examples
    --------
    >>> text = with_checksums('name = "lake"  # ours', {"frames.parquet": "00"})
    >>> text.splitlines()[:3]
    ['name = "lake"  # ours', '', '[checksums]']
    >>> with_checksums(text, {"frames.parquet": "00"}) == text
    True
    """
    places = LocationsPart.model_validate(tomllib.loads(text).get(STATED, {}))
    own = {FILE_NAME: _of_text(text), STATED: _of_places(places)}
    return _without(text) + "\n" + dump_toml({PART: {**own, **tables}})


# pyarrow carries no types.
#: Estimated poses, best first: as logged, by RTK, by the filters of `wildlab.navigation`, found on board.
PREFERRED = ("logged", "rtk", "mekf", "observer", "onboard", "autopilot")

arrow: Any = pyarrow
parquet: Any = pyarrow.parquet


@dataclass(repr=False)
class Flight(Brief):
    """A flight in memory. Printed, it shows how much there is of it and no place.

    Attributes
    ----------
    manifest
        What `flight.toml` says.
    nav
        Pose tables by source name.
    tables
        The other tables by name (see `wildlab.flight.schema.TABLES`), those that are there.
    folder
        Where it was loaded from or saved to; None while it only exists in memory.
    terrain
        The ground, in n; None where the flight has no elevation map.
    """

    manifest: Manifest
    nav: dict[str, pd.DataFrame] = field(default_factory=dict)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    folder: Path | None = None
    terrain: Terrain | None = None

    @property
    def name(self) -> str:
        """That of its folder, which reports have too; of one in memory, what its manifest states."""
        return self.manifest.name if self.folder is None else flight_name(self.folder, self.manifest.name)

    @property
    def frames(self) -> pd.DataFrame | None:
        return self.tables.get("frames")

    @property
    def gimbal(self) -> pd.DataFrame | None:
        return self.tables.get("gimbal")

    @property
    def imu(self) -> pd.DataFrame | None:
        return self.tables.get("imu")

    @property
    def gnss(self) -> pd.DataFrame | None:
        return self.tables.get("gnss")

    @property
    def detections(self) -> pd.DataFrame | None:
        return self.tables.get("detections")

    @property
    def truth(self) -> pd.DataFrame | None:
        return self.tables.get("truth")

    @property
    def timed(self) -> bool:
        """Whether stamps are seconds, and not the numbers of images."""
        return self.manifest.time.kind == "utc"

    def frame_rows(self, frame_ids: pd.Series) -> Indices:
        """The row of each among the frames, -1 for none."""
        return pd.Index(self.table("frames")["frame_id"]).get_indexer(pd.Index(frame_ids))

    @property
    def calibration(self) -> Path | None:
        """What was learnt on another flight, where this one was imported with it."""
        path = self.folder / CALIBRATION if self.folder is not None else None
        return path if path is not None and path.is_file() else None

    def brief(self) -> Summary:
        """How much there is of it: what it is, how long, its tables; no coordinates and no origin."""
        m = self.manifest
        tables = (*self.nav.values(), *self.tables.values())
        stamps = [table["time_s"] for table in tables if "time_s" in table]
        known = pd.concat(stamps).dropna() if stamps else pd.Series(dtype=float)
        timed = m.time.kind == "utc" and len(known) > 0
        named = [table["target_id"] for table in tables if "target_id" in table]
        targets = pd.concat(named).replace("", None).nunique() if named else 0
        rows = [
            ("kind", m.kind if m.twin is None else f"{m.kind}, seed {m.twin.seed}"),
            ("duration", f"{known.max() - known.min():.1f} s" if timed else "not known"),
            ("nav sources", _counts(self.nav)),
            ("tables", _counts(self.tables)),
            ("targets", str(targets)),
            ("locations", m.locations.sensitivity),
        ]
        return Summary(f"Flight {self.name}", rows)

    def table(self, name: str) -> pd.DataFrame:
        """A table that must be there.

        Raises
        ------
        WildlabError
            Where the flight has no such table.
        """
        if name not in self.tables:
            known = f"use one of {', '.join(TABLES)}"
            fix = f"add {name}.parquet: {TABLES[name].meaning}" if name in TABLES else known
            raise WildlabError(f"this flight has no table {name!r}", fix, file=self.folder)
        return self.tables[name]

    def pose_source(self, name: str | None = None) -> tuple[str, pd.DataFrame]:
        """Name and table of a nav source; without a name, of the best of `estimated_sources`.

        Raises
        ------
        WildlabError
            Where there is none of that name, or no estimated one.
        """
        known = self.estimated_sources
        wanted = next(iter(known), None) if name is None else name
        if wanted is not None and wanted in self.nav:
            return wanted, self.nav[wanted]
        raise WildlabError(
            f"there is no nav source {name!r}" if name else "this flight has no estimated poses",
            f"choose one: --source {' or '.join(known)}" if known else "add them as nav/<source>.parquet",
            file=self.folder,
            field="nav",
        )

    @property
    def estimated_sources(self) -> list[str]:
        """Nav sources that have rows, best first: `PREFERRED`, then others by name.

        The truth of a twin, or a reference that is called so, is what poses are held against: it is named or
        not taken.
        """
        found = [name for name, nav in self.nav.items() if len(nav) and not name.startswith("truth")]
        rank = {name: place for place, name in enumerate(PREFERRED)}
        return sorted(found, key=lambda name: (rank.get(name, len(rank)), name))


def _counts(tables: Mapping[str, pd.DataFrame]) -> str:
    """``"imu 1200, gnss 60"``, rows by table."""
    return ", ".join(f"{name} {len(table)}" for name, table in tables.items()) or "none"


def load_flight(folder: Path | str) -> Flight:
    """Read a flight folder and check its structure (not its values: that is `check_flight`).

    Parameters
    ----------
    folder
        The flight folder, with ``flight.toml``.

    Returns
    -------
    Flight
        With its tables as they are on disk.

    Raises
    ------
    WildlabError
        Where the folder, the manifest, a table or a column is missing, a type is wrong, a file lies outside
        of the folder, or a table is not the one whose checksum the manifest has.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from wildlab.simulation.twins import simulate_twin
    >>> with TemporaryDirectory() as folder:
    ...     _ = save_flight(simulate_twin("large-ship", 1), Path(folder) / "twin")
    ...     load_flight(Path(folder) / "twin").manifest.kind
    'twin'
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise WildlabError("there is no such folder", "check the path of the flight", file=folder)
    manifest = read_manifest(inside(folder, FILE_NAME, file=folder, field=FILE_NAME))
    # Before anything is read: a damaged table may well be a readable one.
    verify(folder, manifest.checksums)
    nav = {}
    nav_folder = folder / "nav"
    if nav_folder.exists():
        inside(folder, "nav", file=folder, field="nav")
        for path in sorted(nav_folder.glob("*.parquet")):
            if not is_safe_name(path.stem):
                raise WildlabError(f"{path.stem!r} cannot name a nav source", SAFE, file=path)
            nav[path.stem] = _read(folder, f"nav/{path.name}", NAV)
    tables = {
        name: _read(folder, f"{name}.parquet", table)
        for name, table in TABLES.items()
        if os.path.lexists(folder / f"{name}.parquet")
    }
    for name in (TERRAIN, CALIBRATION):
        if os.path.lexists(folder / name):
            _present(inside(folder, name, file=folder, field=name))
    terrain = read_terrain(folder / TERRAIN) if os.path.lexists(folder / TERRAIN) else None
    return Flight(manifest.model_copy(update={"checksums": {}}), nav, tables, folder, terrain)


def _present(path: Path) -> None:
    try:
        regular_size(path)
    except FileNotFoundError:
        raise WildlabError(MISSING, RESTORE, file=path) from None


def _read(folder: Path, name: str, table: Table) -> pd.DataFrame:
    path = inside(folder, name, file=folder, field=name)
    _present(path)
    try:
        # ParquetFile, not read_table: the latter would read columns out of folder names such as "a=b".
        with parquet.ParquetFile(path) as stored:
            # What became a column of the table is let go of: ten hours of a sensor are half a gigabyte, once.
            data = stored.read().to_pandas(ignore_metadata=True, self_destruct=True)
    except (arrow.ArrowException, OSError, ValueError) as error:
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        problem = f"is not a readable Parquet file ({first})"
        raise WildlabError(problem, "write the table again", file=path) from None
    return conform(table, data, path, ours=True)


def save_flight(
    flight: Flight, folder: Path | str, *, overwrite: bool = False, calibration: Learnt | None = None
) -> Flight:
    """Write a flight folder, whole or not at all. Returns the flight as it now stands there.

    Parameters
    ----------
    flight
        The flight.
    folder
        A new or an empty folder, or one that holds a flight.
    overwrite
        Whether a flight that is there may be replaced.
    calibration
        What was learnt on another flight; left out, the one that the flight has, if any.

    Returns
    -------
    Flight
        As it stands in the folder.

    Raises
    ------
    WildlabError
        Where a table does not fit the schema, the folder holds something else, or it holds a flight and
        `overwrite` is false.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from wildlab.simulation.twins import simulate_twin
    >>> with TemporaryDirectory() as folder:
    ...     saved = save_flight(simulate_twin("large-ship", 1), folder)
    ...     sorted(path.name for path in saved.folder.iterdir())
    ['detections.parquet', 'flight.toml', 'frames.parquet', 'nav', 'truth.parquet']
    """
    target = Path(folder)
    _refuse(target, overwrite)
    nav = {}
    for source, table in flight.nav.items():
        if not is_safe_name(source):
            raise WildlabError(f"{source!r} cannot name a nav source", SAFE, file=target, field="nav")
        nav[source] = conform(NAV, table, f"nav/{source}")
    tables = {}
    for name, table in flight.tables.items():
        if name not in TABLES:
            known = ", ".join(TABLES)
            raise WildlabError(f"{name!r} is not a table of a flight", f"use one of {known}", file=target)
        tables[name] = conform(TABLES[name], table, name)
    with _replacing(target, overwrite) as folder_now:
        if nav:
            (folder_now / "nav").mkdir()
        for source, table in nav.items():
            write_table(table, folder_now / "nav" / f"{source}.parquet")
        for name, table in tables.items():
            write_table(table, folder_now / f"{name}.parquet")
        if flight.terrain is not None:
            write_terrain(flight.terrain, folder_now / TERRAIN)
        if calibration is not None:
            write_calibration(calibration, folder_now / CALIBRATION)
        elif flight.calibration is not None:
            shutil.copyfile(flight.calibration, folder_now / CALIBRATION)
        text = with_checksums(manifest_toml(flight.manifest), checksums_of(folder_now))
        (folder_now / FILE_NAME).write_text(text, encoding="utf-8")
    return Flight(flight.manifest, nav, tables, target, flight.terrain)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a table of a flight as Parquet."""
    # Without pandas' own metadata, which names its version: the same flight gives the same bytes.
    plain = arrow.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    parquet.write_table(plain, path)


def _refuse(target: Path, overwrite: bool) -> None:
    if not os.path.lexists(target):
        return
    if not target.is_dir():
        raise WildlabError("is a file, and a flight is a folder", "choose another name", file=target)
    there = sorted(path.relative_to(target).as_posix() for path in target.rglob("*") if not path.is_dir())
    if there and FILE_NAME not in there:
        raise WildlabError(
            f"this folder holds other things ({there[0]}) and no flight",
            "choose an empty folder",
            file=target,
        )
    if there and not overwrite:
        fix = "choose another, or overwrite it (--overwrite; in Python overwrite=True)"
        raise WildlabError("there is a flight already", fix, file=target)
    known = {FILE_NAME, TERRAIN, CALIBRATION, *(f"{name}.parquet" for name in TABLES)}
    for name in there:
        if name not in known and not re.fullmatch(r"nav/[^/]+\.parquet", name):
            problem = f"{name!r} is no part of a flight: it would be lost"
            raise WildlabError(problem, "move it elsewhere first", file=target)


@contextlib.contextmanager
def _replacing(target: Path, overwrite: bool) -> Iterator[Path]:
    """A temporary sibling that takes the place of `target` when the block ends well."""
    target = target.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    new = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.", suffix=".partial"))
    old = None
    try:
        new.chmod(0o755)
        yield new
        if target.exists() and any(target.iterdir()):
            _refuse(target, overwrite)
            old = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.", suffix=".old"))
            target.rename(old)
        try:
            new.rename(target)
        except BaseException:
            if old is not None:
                old.rename(target)
            raise
    finally:
        shutil.rmtree(new, ignore_errors=True)
        if old is not None and old.exists() and target.exists():
            shutil.rmtree(old, ignore_errors=True)


#: Nodes that are kept of a terrain, and read of a file that claims more.
MOST_NODES = 25_000_000
#: The tag of the standard deviation.
_SD = "WILDLAB_SD_M"
_FIX = "lay the terrain again: wildlab terrain"


def write_terrain(terrain: Terrain, path: Path) -> None:
    """Write a terrain: 32-bit heights in metres, columns east and rows south, no CRS and so no place.

    Parameters
    ----------
    terrain
        In the flight's n.
    path
        Of the file.
    """
    import rasterio
    from rasterio import Affine

    rows, columns = terrain.height.shape
    far_north = terrain.north + (rows - 1) * terrain.step
    half = terrain.step / 2
    transform = Affine(terrain.step, 0.0, terrain.east - half, 0.0, -terrain.step, far_north + half)
    with gdal(), rasterio.open(
        path, "w", driver="GTiff", width=columns, height=rows, count=1, dtype="float32", nodata=math.nan,
        transform=transform, compress="deflate", predictor=3, tiled=True, blockxsize=256, blockysize=256,
    ) as data:  # fmt: skip
        data.write(terrain.height[::-1], 1)
        # The first node again: the transform has it with the rounding of a sum.
        data.update_tags(
            **{
                _SD: repr(float(terrain.sd)),
                "NORTH_M": repr(float(terrain.north)),
                "EAST_M": repr(float(terrain.east)),
            }
        )


def read_terrain(path: Path) -> Terrain:
    """Read a terrain that `write_terrain` wrote.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Terrain

    Raises
    ------
    WildlabError
        Where it is no such file, or damaged.
    """
    import rasterio

    regular_size(path)
    with gdal():
        try:
            with rasterio.open(path, driver="GTiff") as data:
                terrain = _terrain(data, path)
        except WildlabError:
            raise
        except Exception as error:  # rasterio's errors share no base but Exception
            said = printable((str(error.__cause__ or error).strip() or "?").splitlines()[0])[:120]
            raise WildlabError(f"is not a terrain that can be read ({said})", _FIX, file=path) from None
    return terrain


def _terrain(data: Any, path: Path) -> Terrain:
    t, tags = data.transform, data.tags()
    sound = data.count == 1 and data.dtypes == ("float32",) and data.crs is None and _SD in tags
    if not sound or t.b or t.d or t.a <= 0 or not math.isclose(t.a, -t.e):
        raise WildlabError("is not a grid of heights in frame n", _FIX, file=path)
    if data.width * data.height > MOST_NODES or math.prod(data.block_shapes[0]) > MOST_NODES:
        raise WildlabError(
            f"claims {data.width:,} x {data.height:,} nodes, and {MOST_NODES:,} are the most", _FIX, file=path
        )
    try:
        north, east, sd = float(tags["NORTH_M"]), float(tags["EAST_M"]), float(tags[_SD])
    except (KeyError, ValueError):
        raise WildlabError("does not say where its first node is", _FIX, file=path) from None
    return Terrain(np.ascontiguousarray(data.read(1)[::-1]), north, east, float(t.a), sd)
