"""Import: plain tables and a recipe become a flight.

What a recipe may say is in `recipe_model`; how its writers should say it, in `data/recipes/README.md`.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import BaseModel

from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import read_camera, read_learnt, refuse_other_camera
from wildlab.flight.checks.check import problems_of
from wildlab.flight.checks.findings import part_of
from wildlab.flight.clocks import between, poses_at
from wildlab.flight.files import TOML_LIMIT, check_model, inside
from wildlab.flight.manifest import (
    CameraPart,
    GnssPart,
    ImuPart,
    MagnetometerPart,
    Manifest,
    TerrainSays,
    make_manifest,
)
from wildlab.flight.raw_files import RawFiles, nanoseconds, plain_numbers
from wildlab.flight.recipe_tables import (
    LocalFrame,
    Rows,
    frames_of_rows,
    read_detections,
    read_frames,
    read_poses,
    read_sensors,
    read_truth,
)
from wildlab.flight.recipes import Block, Recipe, read_recipe
from wildlab.flight.schema import POSITION
from wildlab.flight.store import Flight, save_flight
from wildlab.flight.terrain import lay_terrain
from wildlab.geometry.frames import Array

#: Parts that a manifest has as the recipe states them.
_AS_STATED = (
    "name",
    "locations",
    "platform",
    "mount",
    "clocks",
    "uncertainty",
    "scoring",
    "sensors",
    "targets",
)
_ON_BOARD: dict[str, type[BaseModel]] = {"imu": ImuPart, "gnss": GnssPart, "magnetometer": MagnetometerPart}


def import_flight(
    recipe_path: Path | str,
    source: Path | str | None,
    into: Path | str,
    overwrite: bool = False,
    calibration: Path | None = None,
    terrain: TerrainSays | None = None,
) -> Flight:
    """Make a flight folder from plain tables, whole or not at all. The tables are only read.

    Parameters
    ----------
    recipe_path
        The recipe (TOML).
    source
        Folder of the tables; by default that of the recipe.
    into
        Folder of the flight.
    overwrite
        Whether a flight that is there already may be replaced.
    calibration
        What `wildlab calibrate` learnt on another flight: kept with this one, applied when it is evaluated.
    terrain
        An elevation map, in place of the one that the recipe may name.

    Returns
    -------
    Flight
        As it stands in the folder.

    Raises
    ------
    WildlabError
        Naming the file, the column and the part of the recipe where something is missing or wrong, or what
        `check_flight` calls a problem; or where the calibration is of another camera, or the elevation map
        cannot be used.

    Examples
    --------
    >>> import_flight("my-recipe.toml", "logs", "flights/mine")  # doctest: +SKIP
    Flight mine
    """
    recipe_path = Path(recipe_path)
    recipe = read_recipe(recipe_path)
    folder = recipe_path.parent if source is None else Path(source)
    if not folder.is_dir():
        raise WildlabError("there is no such folder", "name that of the tables with --source", file=folder)
    learnt = None if calibration is None else read_learnt(calibration)
    flight = _build(recipe, RawFiles(folder, recipe_path, recipe.tables, recipe.logs))
    _refuse_problems(flight, recipe, folder)
    if learnt is not None:
        refuse_other_camera(flight.manifest, learnt)
    if terrain is not None:
        flight = lay_terrain(flight, Path(terrain.file), terrain)
    elif recipe.terrain is not None:
        name = recipe.terrain.file
        path = inside(folder, name, file=recipe_path, field="terrain.file")
        flight = lay_terrain(flight, path, recipe.terrain)
    return save_flight(flight, into, overwrite=overwrite, calibration=learnt)


def _build(recipe: Recipe, raw: RawFiles) -> Flight:
    camera = _camera(recipe, raw)
    frames = read_frames(recipe, raw)
    poses: dict[str, Rows] = {}
    for name, block in recipe.poses.items():
        part = f"poses.{name}"
        table = raw.series(block, part)
        ids = None
        if block.time is None:
            ids = frames_of_rows(frames, recipe, block, block.frame, table, part)
        poses[name] = read_poses(recipe, block, table, part, ids)
    sensors = read_sensors(recipe, raw)
    places = _places(recipe, poses, sensors)
    stamps = [frames.stamps, *(one.stamps for one in poses.values())]
    epoch = _epoch(recipe, stamps + [one.stamps for one in sensors.values()])
    start = 0 if epoch is None else nanoseconds(epoch)

    time_s = np.arange(len(frames.columns["frame_id"]), dtype=float)
    if frames.stamps is not None:
        time_s = (frames.stamps - start) / 1e9
    ids = frames.columns["frame_id"]
    tables = {} if recipe.frames is None else {"frames": pd.DataFrame({**frames.columns, "time_s": time_s})}
    for name, rows in sensors.items():
        stamps_s = np.asarray((rows.stamps - start) / 1e9)
        position = None if rows.position is None else places.ned(rows.position, "gnss")
        tables[name] = rows.table(stamps_s, position)
    flight_time = time_s + recipe.clocks.camera_offset_s
    nav = {}
    for name, rows in poses.items():
        times = _pose_times(rows, start, pd.Series(flight_time, index=ids), recipe, raw, name)
        if rows.position is not None:
            nav[name] = rows.table(times, places.ned(rows.position, "poses"))
        else:
            position = _positions_of_receiver(recipe, tables, times)
            known = np.isfinite(position[:, 0])
            nav[name] = rows.table(times, position)[known].reset_index(drop=True)
    if recipe.truth:
        truth = [
            read_truth(one, raw, recipe, f"truth[{i}]", places, start) for i, one in enumerate(recipe.truth)
        ]
        tables["truth"] = pd.concat(truth, ignore_index=True)
    for name in recipe.files:
        if name not in raw.hashes:
            raw.read(name, "files")
    notes = [recipe.description, *(one.note for one in poses.values())]
    manifest = _manifest(recipe, raw, camera, places, epoch, " ".join(filter(None, notes)))
    if recipe.detections:
        _refuse_problems(Flight(manifest, nav, tables), recipe, raw.folder)
        of_frame = pd.DataFrame(np.nan, ids, ["north", "east", "down", "heading"])
        if nav:
            lens, R, _ = poses_at(next(iter(nav.values())), flight_time, ids, math.inf)
            of_frame[["north", "east", "down"]] = lens
            # The horizontal direction of the axis ahead: the yaw, whatever roll and pitch are.
            of_frame["heading"] = np.arctan2(R[:, 1, 0], R[:, 0, 0])
        image = (math.nan, math.nan) if camera is None else (float(camera.width_px), float(camera.height_px))
        detections = [
            read_detections(one, raw, recipe, f"detections[{i}]", frames, places, image, of_frame)
            for i, one in enumerate(recipe.detections)
        ]
        filled = [one for one in detections if len(one)]
        tables["detections"] = pd.concat(filled or detections, ignore_index=True)
        # Files of detections are read last; the manifest names them too.
        manifest = _manifest(recipe, raw, camera, places, epoch, manifest.description)
    return Flight(manifest, nav, tables)


def _camera(recipe: Recipe, raw: RawFiles) -> CameraPart | None:
    """The camera, numbers that stand in columns filled in; None where the recipe has none.

    Raises
    ------
    WildlabError
        Where a column is missing or does not hold one constant, or a number makes no camera; or the camera's
        own file is missing or wrong.
    """
    if recipe.camera is None:
        return None
    if isinstance(recipe.camera, str):
        raw.read(recipe.camera, "camera", TOML_LIMIT)
        return read_camera(raw.folder / recipe.camera).camera
    data, rows, columns = dict(recipe.camera), None, {}
    if stated := {key: data.pop(key) for key in Block.model_fields if key in data}:
        rows = raw.table(check_model(Block, stated, raw.recipe), "camera")
        columns = {name: one for name, one in data.items() if isinstance(one, str) and name != "name"}
        for name, column in columns.items():
            found = plain_numbers(rows, column, f"camera.{name}")
            fix = "import each camera or zoom by itself"
            rows.refuse(found != found[0], "the camera changes", fix, column, f"camera.{name}")
            data[name] = float(found[0])
    try:
        return check_model(CameraPart, data, raw.recipe)
    except WildlabError as error:
        name = error.field or ""
        if rows is None or name not in columns:
            raise WildlabError(error.problem, error.fix, file=raw.recipe, field=f"camera.{name}") from None
        raise rows.fail(error.problem, error.fix, columns[name], f"camera.{name}", 0) from None


def _places(recipe: Recipe, poses: dict[str, Rows], sensors: dict[str, Rows]) -> LocalFrame:
    """What takes positions to frame n; without an origin in the recipe, the first pose is it, or the first
    satellite position where there are no poses."""
    vertical = recipe.vertical
    if recipe.origin is not None:
        o = recipe.origin
        origin = (math.radians(o.latitude_deg), math.radians(o.longitude_deg), o.height_m)
    else:
        known = [("poses", one.position) for one in poses.values() if one.position is not None]
        known += [("gnss", one.position) for one in sensors.values() if one.position is not None]
        what, first = known[0]
        latitude, longitude, height = first.values[0]
        off = vertical.correction_m if what in vertical.taken_off else 0.0
        origin = (float(latitude), float(longitude), float(height) - off)
    return LocalFrame(origin, vertical.correction_m, vertical.taken_off)


def _positions_of_receiver(recipe: Recipe, tables: dict[str, pd.DataFrame], times: Array) -> Array:
    """Where the receiver was, (N, 3), for poses without positions of their own."""
    if recipe.gnss is None:
        raise ValueError("poses without positions")
    gnss = tables["gnss"]
    stamps = gnss["time_s"].to_numpy() + recipe.clocks.gnss_offset_s - recipe.gnss.latency_s
    return between(stamps, gnss[POSITION].to_numpy(), times, "gnss")


def _epoch(recipe: Recipe, stamps: list[Any]) -> datetime | None:
    """The epoch of the recipe, else the last whole second before anything happens."""
    if recipe.time.epoch is not None:
        return recipe.time.epoch.astimezone(UTC)
    if recipe.time.kind == "sequence":
        return None
    first = min(int(one.min()) for one in stamps if one is not None)
    return datetime.fromtimestamp(first // 1_000_000_000, UTC)


def _pose_times(
    poses: Rows,
    start: int,
    of_frame: pd.Series,
    recipe: Recipe,
    raw: RawFiles,
    name: str,
) -> Array:
    """Flight time of each pose: its own stamp, or that of its frame."""
    if poses.stamps is not None:
        return np.asarray((poses.stamps - start) / 1e9)
    of_frame = of_frame[~of_frame.index.duplicated()]
    strange = [frame for frame in poses.ids if frame not in of_frame.index] if poses.ids is not None else []
    if strange:
        block = recipe.frames
        raise WildlabError(
            f"{strange[0]!r} is not one of the frames" + (f" of {block.file}" if block else ""),
            "add or rename it",
            file=raw.folder / _file(recipe, recipe.poses[name].file),
            field=f"{recipe.poses[name].frame} (in [poses.{name}.frame])",
        )
    return np.asarray(of_frame.reindex(poses.ids), np.float64)


def _manifest(
    recipe: Recipe,
    raw: RawFiles,
    camera: CameraPart | None,
    places: LocalFrame,
    epoch: datetime | None,
    description: str,
) -> Manifest:
    latitude, longitude, height = places.origin
    place = {
        "latitude_deg": math.degrees(latitude),
        "longitude_deg": math.degrees(longitude),
        "height_m": height,
    }
    on_board = {
        name: {key: getattr(recipe.on_board[name], key) for key in part.model_fields}
        for name, part in _ON_BOARD.items()
        if name in recipe.on_board
    }
    return make_manifest(
        {
            **{name: getattr(recipe, name) for name in _AS_STATED},
            **on_board,
            "kind": "logged",
            "description": description,
            "origin": place if recipe.origin is None else recipe.origin.model_dump(),
            "camera": camera,
            "time": {"kind": recipe.time.kind, "epoch": epoch},
            "vertical": recipe.vertical.model_dump(include={"reference", "correction_m", "note"}),
            "sources": [
                {"file": name, "sha256": digest, "what": recipe.files.get(name, "")}
                for name, digest in raw.hashes.items()
            ],
        },
        raw.recipe,
    )


def _refuse_problems(flight: Flight, recipe: Recipe, folder: Path) -> None:
    """Raise the first problem that `check_flight` finds, in terms of the raw file it comes from."""
    blocks: dict[str, list[Any]] = {
        **{name: [one] for name, one in recipe.on_board.items()},
        **{f"nav/{name}": [one] for name, one in recipe.poses.items()},
        "frames": [] if recipe.frames is None else [recipe.frames],
        "truth": [*recipe.truth],
        "detections": [*recipe.detections],
    }
    for finding in problems_of(flight):
        part, used = part_of(finding.table), blocks.get(finding.table, [])
        if finding.code == "all-truth-far":  # either may be the wrong one
            part, used = "poses] or [truth", [*recipe.poses.values(), *used]
        raise WildlabError(
            finding.clause,
            finding.remedy,
            file=" and ".join(dict.fromkeys(str(folder / _file(recipe, one.file)) for one in used)),
            field=f"{finding.field} (from [{part}])",
        )


def _file(recipe: Recipe, name: str) -> str:
    """The file a block reads, also where it names one of the tables or logs."""
    if name in recipe.logs:
        return recipe.logs[name].file
    return recipe.tables[name].file if name in recipe.tables else name
