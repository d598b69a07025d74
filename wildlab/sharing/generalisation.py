"""A flight, generalised: the same motion, seen from a point that is not named, on a day that is not told.

Nothing is masked afterwards. Coordinates count from the middle of the flight, heights from its ground, time
from its first sample; names are neutral, in the order of the true ones; the sensors measure what they would
have at the cell's middle; the camera has rounded focal lengths, and pixels where it would have seen the same.
What is computed from such a flight is what would be computed from the true one, to rounding errors, but for
the size of pixels.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from string import ascii_uppercase
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.navigate import REFERENCES
from wildlab.analysis.overview import ground_height
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import Learnt, beside_zone
from wildlab.flight.clocks import poses_at
from wildlab.flight.manifest import (
    CameraPart,
    MagnetometerPart,
    Manifest,
    SensorPart,
    Settings,
    TargetsPart,
    make_manifest,
)
from wildlab.flight.schema import COVARIANCE_COLUMNS, FIELD, NAV, POSITION, TABLES, VELOCITY
from wildlab.flight.store import PREFERRED, Flight
from wildlab.geometry.frames import Array, Earth, local_earth, ned_to_geodetic
from wildlab.navigation.aiding import earth_field
from wildlab.sharing.tiers import Cell, Treatment, cell_of

#: Names that say what a thing is and nothing of where: wildlab's own, and those of kinds of sensors. Poses
#: that a report looks up by name keep it: by another name they would be held against another reference.
PLAIN = frozenset(
    (
        *REFERENCES,
        *PREFERRED,
        *("truth", "mekf", "observer", "ekf", "gnss", "imu", "gimbal"),
        *("detector", "click", "clicks", "camera", "thermal", "infrared", "ir", "visible", "rgb", "optical"),
        *("eo", "radar", "lidar", "ais", "sonar"),
    )
)
#: Columns of text whose names are of one kind, by what a neutral name of it begins with.
KINDS: dict[str, str] = {
    "frame_id": "frame",
    "detection_id": "detection",
    "target_id": "target",
    "group": "part",
    "source": "sensor",
    "sensor": "sensor",
}


@dataclass
class Names:
    """Neutral names by kind: ``{"target": {"Sarah the rhino": "target-1"}}``."""

    by_kind: dict[str, dict[str, str]] = field(default_factory=dict)

    def learn(self, kind: str, names: Iterable[str]) -> None:
        """Give each name of a kind its neutral one; once for all that there are of the kind.

        Names of `PLAIN` stay. The numbers follow the order of the true names: what sorts by name, or draws
        random numbers name by name, gives the same results with either.
        """
        known = sorted({name for name in names if name} - PLAIN)
        digits = len(str(len(known)))
        self.by_kind[kind] = {
            name: f"{_begins(kind, name)}-{i:0{digits}d}" for i, name in enumerate(known, start=1)
        }

    def of(self, kind: str, name: str) -> str:
        """The neutral name; of nothing, nothing."""
        return name if not name or name in PLAIN else self.by_kind.get(kind, {}).get(name, kind)


def _begins(kind: str, name: str) -> str:
    """What a neutral name begins with; poses that are a twin's own truth are known by it."""
    return "truth" if kind == "poses" and name.startswith("truth") else kind


def learn_names(
    nav: Mapping[str, pd.DataFrame], tables: Mapping[str, pd.DataFrame], more: Iterable[str]
) -> Names:
    """Neutral names for all that the tables of a flight name.

    Parameters
    ----------
    nav, tables
        Of the flight.
    more
        Further names of sensors, from the manifest.

    Returns
    -------
    Names
    """
    found: dict[str, set[str]] = {kind: set() for kind in KINDS.values()}
    found["sensor"] |= set(more)
    for table in (*nav.values(), *tables.values()):
        for column, kind in KINDS.items():
            if column in table:
                found[kind] |= {str(name) for name in table[column].dropna().unique()}
    names = Names()
    for kind, known in found.items():
        names.learn(kind, known)
    names.learn("poses", nav)
    return names


def rename_identifiers(table: pd.DataFrame, names: Names, schema: str) -> pd.DataFrame:
    """A table with neutral names, and without columns that the schema does not know: they may hold anything.

    Parameters
    ----------
    table
        Is not changed.
    names
        From `learn_names`.
    schema
        Name of the table, or ``"nav"``.

    Returns
    -------
    DataFrame
    """
    known = (NAV if schema == "nav" else TABLES[schema]).column_names
    kept = table[[name for name in table.columns if name in known]].copy()
    for column, kind in KINDS.items():
        if column in kept:
            # A plain dictionary: a name is looked up as it is, and a missing one stays missing.
            kept[column] = [names.of(kind, name) if isinstance(name, str) else name for name in kept[column]]
    return kept


class Neutral(NamedTuple):
    """Settings as a copy has them, and the sensors that they no longer speak of, as they do not exist."""

    settings: Settings
    left_out: tuple[str, ...]


def whole_quarters(offset_s: float) -> float:
    """What of a clock's offset may be its zone of time, s.

    Examples
    --------
    >>> whole_quarters(7198.5), whole_quarters(-0.5)
    (7200.0, 0.0)
    """
    return offset_s - beside_zone(offset_s)


def neutral_hulls(targets: dict[str, Any]) -> None:
    """Give letters to the kinds of hulls in a ``[targets]`` that is given as plain values; it is changed.

    No numbers: a length stands beside the name.
    """
    for letter, hull in zip(ascii_uppercase, (targets.get("many") or {}).get("hulls", ()), strict=False):
        hull["name"] = f"kind {letter}"


def scale_pixels(noise: dict[str, Any], more: float) -> None:
    """Scale a standard deviation in pixels, where plain values have one, as the camera's pixels are."""
    if noise.get("pixel_px"):
        noise["pixel_px"] *= more


def neutral_settings(
    settings: Settings, names: Names, moved: Mapping[str, float], pixels: float = 1.0
) -> Neutral:
    """Settings that tell a filter of a generalised flight the same.

    Parameters
    ----------
    settings
        As they were.
    names
        Neutral names by the true ones.
    moved
        By the true name of a sensor, what was added to its stamps in the generalised flight, s.
    pixels
        How much larger pixels are there.

    Returns
    -------
    Neutral

    Raises
    ------
    WildlabError
        Where the offset of a clock tells its zone, and is not that of the flight.
    """
    known = names.by_kind.get("sensor", {})
    sensors: dict[str, Any] = {}
    left_out = []
    for name, part in settings.sensors.items():
        if name not in known and name not in PLAIN:
            # Two of them would have one name.
            left_out.append(name)
            continue
        data = part.model_dump(exclude_none=True, exclude_unset=True)
        scale_pixels(data.get("noise", {}), pixels)
        if "clock_offset_s" in data:
            data["clock_offset_s"] = part.clock_offset_s - moved.get(name, 0.0)
            if whole_quarters(data["clock_offset_s"]):
                here = f", and flight.toml about {moved[name]:g} s" if name in moved else ""
                raise WildlabError(
                    f"the settings add {part.clock_offset_s:g} s to the stamps of {name!r}{here}, which "
                    "tells a zone of time",
                    "state this offset in flight.toml and follow the targets again",
                    field=f"sensors.{name}.clock_offset_s",
                )
        sensors[names.of("sensor", name)] = data
    targets = settings.targets.model_dump(exclude_none=True, exclude_unset=True)
    neutral_hulls(targets)
    return Neutral(Settings.model_validate({"sensors": sensors, "targets": targets}), tuple(left_out))


def names_in(settings: Settings) -> tuple[str, ...]:
    """All names that somebody gave in settings: of sensors, and of kinds of targets."""
    return *settings.sensors, *hulls_of(settings.targets)


def hulls_of(targets: TargetsPart) -> tuple[str, ...]:
    """What the kinds of targets are called that many are followed of; a name like a neutral one is none."""
    hulls = targets.many.hulls if targets.many is not None else ()
    return tuple(hull.name for hull in hulls if not re.fullmatch("kind [A-Z]", hull.name))


_FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
_RATE = ["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
#: The field that stands for the true one: due north, 60 degrees down, uT.
USUAL_FIELD, USUAL_DECLINATION_DEG, USUAL_INCLINATION_DEG = 50.0, 0.0, 60.0


def gravity_at(earth: Earth, p: Array) -> Array:
    """Gravity in n at places (N, 3) in n, m/s^2, as `wildlab.navigation` reckons with it."""
    g = earth.gravity + earth.gradient * p[:, 2]
    return np.column_stack([-g * earth.curvature * p[:, 0], -g * earth.curvature * p[:, 1], g])


def moved_imu(
    imu: pd.DataFrame, nav: pd.DataFrame | None, shift: Array, here: Earth, there: Earth
) -> pd.DataFrame:
    """Inertial samples as they would have been at another place, with the same motion.

    Parameters
    ----------
    imu
        Of the flight.
    nav
        Poses over time, with attitudes; None where there are none: then the specific force is stretched by
        the ratio of both gravities, and the turning of the Earth stays.
    shift
        (3,) m: the new origin of n in the old one.
    here, there
        The Earth at the true origin and at the one that stands for it.

    Returns
    -------
    DataFrame
    """
    f, w = imu[_FORCE].to_numpy(float), imu[_RATE].to_numpy(float)
    moved = f * (there.gravity / here.gravity)
    known: NDArray[np.bool_] = np.zeros(len(imu), np.bool_)
    if nav is not None and len(nav) > 1:
        times = imu["time_s"].to_numpy(float)
        p, R, v = _motion(nav, times)
        known = np.asarray(np.isfinite(p).all(axis=1) & np.isfinite(R).all(axis=(1, 2)))
        turning = np.array(there.rate) - np.array(here.rate)
        more = gravity_at(here, p) - gravity_at(there, p - shift)
        more += 2 * np.cross(np.broadcast_to(turning, v.shape), v)
        moved[known] = f[known] + np.einsum("nji,nj->ni", R[known], more[known])
        w[known] += np.einsum("nji,j->ni", R[known], turning)
    return imu.assign(**dict(zip(_FORCE, moved.T, strict=True)), **dict(zip(_RATE, w.T, strict=True)))


def _motion(nav: pd.DataFrame, times: Array) -> tuple[Array, Array, Array]:
    """Places (N, 3), attitudes (N, 3, 3) and velocities (N, 3); NaN, and no velocity, where not known."""
    lean = nav.drop(columns=[name for name in (*COVARIANCE_COLUMNS, "frame_id") if name in nav])
    try:
        p, R, _ = poses_at(lean, times)
    except WildlabError:
        # Poses that cannot be used are none.
        return (
            np.full((len(times), 3), np.nan),
            np.full((len(times), 3, 3), np.nan),
            np.zeros((len(times), 3)),
        )
    v = np.zeros((len(times), 3))
    if set(VELOCITY) <= set(nav):
        known = nav[["time_s", *VELOCITY]].dropna()
        if len(known):
            stamps = known["time_s"].to_numpy(float)
            v = np.column_stack([np.interp(times, stamps, known[name].to_numpy(float)) for name in VELOCITY])
    return p, R, v


def moved_field(
    table: pd.DataFrame,
    nav: pd.DataFrame | None,
    stated: MagnetometerPart,
) -> tuple[pd.DataFrame, float] | None:
    """Magnetic measurements as they would have been in the usual field, and what they were stretched by.

    What is magnetic on board stays in them, stretched likewise.

    Parameters
    ----------
    table
        Of the magnetometer.
    nav
        Poses over time.
    stated
        What the manifest says of the true field, and of what is magnetic on board.

    Returns
    -------
    (DataFrame, float) or None
        None where it cannot be told what the field there did to them: they had better be left out.
    """
    declination, inclination = stated.declination_deg, stated.inclination_deg
    if nav is None or len(nav) < 2 or declination is None or inclination is None:
        return None
    _, R, _ = _motion(nav, table["time_s"].to_numpy(float))
    field = table[FIELD].to_numpy(float)
    iron = np.zeros(3) if stated.hard_iron_ut is None else np.array(stated.hard_iron_ut)
    strength = float(np.nanmedian(np.linalg.norm(field - iron, axis=1)))
    known = np.asarray(np.isfinite(R).all(axis=(1, 2)))
    if not strength > 0 or not known.any():
        return None
    there = earth_field(*np.radians([USUAL_DECLINATION_DEG, USUAL_INCLINATION_DEG]))
    here = earth_field(*np.radians([declination, inclination]))
    field = field + strength * np.einsum("nji,j->ni", R, there - here)
    stretch = USUAL_FIELD / strength
    moved = table.assign(**dict(zip(FIELD, (field * stretch).T, strict=True)))
    return moved.loc[known].reset_index(drop=True), stretch


#: Where a flight is put whose place is withheld: a latitude that is nobody's.
NOWHERE = (45.0, 0.0)
_PLACES = (
    (*POSITION,),
    ("second_north_m", "second_east_m", "second_down_m"),
    (None, None, "plane_down_m"),
)
#: What stands for a hash, which would tell a file that is public.
_NOBODY = "0" * 64


@dataclass(frozen=True)
class Generalised:
    """A generalised flight, what it can say of where and when it was, and what was taken out of it.

    Attributes
    ----------
    flight
        In memory.
    cell
        None where the place is withheld.
    when
        ``"May 2024 (UTC)"``, ``"3 May 2024 (UTC)"``: the day on which the aircraft's poses begin. Nothing
        where the log knows no date.
    names
        Neutral names by the true ones.
    removed
        Lines for the sender only.
    clocks
        By the true name of a sensor, what was added to its stamps so that its offset tells no zone, s.
    pixels
        How much larger a pixel's distance from the principal point is.
    """

    flight: Flight
    cell: Cell | None
    when: str
    names: Names
    removed: tuple[str, ...]
    clocks: dict[str, float] = field(default_factory=dict)
    pixels: float = 1.0


def generalise(flight: Flight, treatment: Treatment, name: str = "flight") -> Generalised:
    """The flight as a copy may show it.

    Parameters
    ----------
    flight
        Is not changed.
    treatment
        From `wildlab.sharing.tiers.treatment_of`.
    name
        What the copy is called.

    Returns
    -------
    Generalised

    Raises
    ------
    WildlabError
        Where clocks of sensors are of several zones of time, and no frame says whose it is.
    """
    true, (flight, zones) = flight, _of_one_zone(flight)
    manifest = flight.manifest
    shift = new_origin(flight)
    place = ned_to_geodetic(shift[None], manifest.origin_tuple())[0]
    lat, lon = math.degrees(place[0]), math.degrees(place[1])
    cell = None if treatment.cell_deg is None else cell_of(lat, lon, treatment.cell_deg, reach(flight, shift))
    there = NOWHERE if cell is None else (cell.latitude_deg, cell.longitude_deg)
    names = learn_names(flight.nav, flight.tables, manifest.sensors)
    offsets = manifest.clocks.model_dump(exclude={"camera_set"})
    clocks = {key: beside_zone(value) for key, value in offsets.items()}
    folded = {key: value - clocks[key] for key, value in offsets.items()}
    start = first_stamp(flight)
    nav = {
        names.of("poses", source): _moved(rename_identifiers(table, names, "nav"), shift, start)
        for source, table in flight.nav.items()
    }
    best = _poses(flight)
    camera, pixels = rounded_camera(manifest.camera)
    tables: dict[str, pd.DataFrame] = {}
    for key, table in flight.tables.items():
        table = rename_identifiers(table, names, key)
        if key == "imu":
            here = local_earth(*manifest.origin_tuple()[::2])
            table = moved_imu(table, best, shift, here, local_earth(math.radians(there[0]), 0.0))
        elif key == "magnetometer":
            moved = moved_field(table, best, manifest.magnetometer)
            if moved is None:
                continue
            table, stretch = moved
        elif key == "detections" and manifest.camera is not None and camera is not None:
            table = _moved_pixels(table, manifest.camera, camera, pixels)
        offset = {"frames": "camera", "truth": "truth", "gnss": "gnss"}.get(key)
        table = _moved(table, shift, start - (folded[f"{offset}_offset_s"] if offset else 0.0))
        # Another clock's stamps tell the zone, and no report looks at them.
        tables[key] = table.drop(columns="time_onboard_s", errors="ignore")
    field: dict[str, Any] = {}
    if "magnetometer" in tables:
        field = {"declination_deg": USUAL_DECLINATION_DEG, "inclination_deg": USUAL_INCLINATION_DEG}
        if (iron := manifest.magnetometer.hard_iron_ut) is not None:
            field["hard_iron_ut"] = tuple(stretch * one for one in iron)
    epoch, when = _date(manifest, first_pose(flight), treatment)
    data = _manifest(manifest, names, clocks, name, pixels)
    if camera is not None:
        data["camera"] = camera.model_dump()
    data["origin"] = {"latitude_deg": there[0], "longitude_deg": there[1], "height_m": 0.0}
    data["time"] = {"kind": manifest.time.kind} | ({"epoch": epoch} if epoch else {})
    data["magnetometer"] = field
    terrain = flight.terrain
    if terrain is not None:
        # Moved as the rest is; what a report draws of it is only what the flight itself shows.
        terrain = replace(
            terrain,
            height=terrain.height + np.float32(shift[2]),
            north=terrain.north - shift[0],
            east=terrain.east - shift[1],
        )
    made = Flight(make_manifest(data), nav, tables, None, terrain)
    return Generalised(made, cell, when, names, tuple(list_removals(true, made, names)), zones, pixels)


def _of_one_zone(flight: Flight) -> tuple[Flight, dict[str, float]]:
    """The flight with stamps of all sensors in its own zone of time, and what that added to each, s."""
    moved = {name: whole_quarters(part.clock_offset_s) for name, part in flight.manifest.sensors.items()}
    moved = {name: by for name, by in moved.items() if by}
    frames = flight.tables.get("frames")
    if not moved or frames is None:
        return flight, {}
    if "sensor" in frames:
        stamps = frames["time_s"] + frames["sensor"].map(lambda name: moved.get(name, 0.0)).astype(float)
    else:
        seen = flight.tables.get("detections")
        sources = () if seen is None else tuple(seen["source"].unique())
        zones = {moved.get(str(name), 0.0) for name in sources} or {0.0}
        if len(zones) > 1:
            raise WildlabError(
                f"clocks of sensors are {max(zones) - min(zones):g} s apart, which tells zones of time",
                "name the sensor of every frame in the column sensor of frames",
                file=flight.folder,
                field="frames.sensor",
            )
        (zone,) = zones
        moved = dict.fromkeys(moved, zone)
        stamps = frames["time_s"] + zone
    sensors = {
        name: part.model_copy(update={"clock_offset_s": part.clock_offset_s - moved[name]})
        if name in moved
        else part
        for name, part in flight.manifest.sensors.items()
    }
    tables = flight.tables | {"frames": frames.assign(time_s=stamps)}
    manifest = flight.manifest.model_copy(update={"sensors": sensors})
    return replace(flight, manifest=manifest, tables=tables), moved


def new_origin(flight: Flight) -> Array:
    """(3,) in n: the middle of the box that the flight was flown in, at the height of its ground.

    It follows from the flight, not from where its origin was put, which may be a place that is known.
    """
    p = _flown(flight)
    if not len(p):
        return np.zeros(3)
    ground = ground_height(flight)
    down = float(p[:, 2].max()) if ground is None else ground[0]
    return np.array([*((p[:, :2].min(axis=0) + p[:, :2].max(axis=0)) / 2), down])


def reach(flight: Flight, middle: Array) -> float:
    """How far from a point (3,) in n anything of the flight was, level, metres."""
    tables = [*flight.nav.values(), *flight.tables.values()]
    p = [table[["north_m", "east_m"]].to_numpy(float) for table in tables if "north_m" in table]
    away = [float(np.nanmax(np.hypot(*(one - middle[:2]).T), initial=0.0)) for one in p if len(one)]
    return max(away, default=0.0)


def first_stamp(flight: Flight) -> float:
    """The first stamp of all tables, in flight time, s."""
    offsets = flight.manifest.clocks
    mine = {"frames": offsets.camera_offset_s, "truth": offsets.truth_offset_s, "gnss": offsets.gnss_offset_s}
    tables = {**{f"nav/{name}": nav for name, nav in flight.nav.items()}, **flight.tables}
    stamps = [
        table["time_s"].dropna().min() + mine.get(name, 0.0)
        for name, table in tables.items()
        if "time_s" in table and table["time_s"].notna().any()
    ]
    return float(min(stamps, default=0.0))


def first_pose(flight: Flight) -> float:
    """When the aircraft's own poses begin, in flight time, s; without any, the first stamp of all tables.

    What others carried is often started before take-off, and midnight may lie between.
    """
    stamps = [nav["time_s"].min() for nav in flight.nav.values() if nav["time_s"].notna().any()]
    return float(min(stamps)) if stamps else first_stamp(flight)


def rounded_camera(camera: CameraPart | None) -> tuple[CameraPart | None, float]:
    """A camera that many others are, and how much larger its pixels' distances from the principal point are.

    The focal length is rounded to half a unit of its second digit (1159 to 1150), and the principal point is
    the middle of the image: calibrated ones tell one camera from all others. Both focal lengths are scaled
    alike, so that noise in pixels stays the same in both directions.
    """
    if camera is None:
        return None, 1.0
    step = 10.0 ** math.floor(math.log10(camera.fx_px)) / 20
    more = round(camera.fx_px / step) * step / camera.fx_px
    changed = {name: getattr(camera, name) * more for name in ("fx_px", "fy_px", "skew_px")}
    changed |= {"cx_px": (camera.width_px - 1) / 2, "cy_px": (camera.height_px - 1) / 2}
    return camera.model_copy(update={**changed, "name": "camera"}), more


def _moved_pixels(table: pd.DataFrame, true: CameraPart, made: CameraPart, more: float) -> pd.DataFrame:
    """Detections where the other camera would have seen them."""
    moved = {
        "u_px": (more, made.cx_px - true.cx_px * more),
        "v_px": (more, made.cy_px - true.cy_px * more),
        "area_px": (more**2, 0.0),
        "major_px": (more, 0.0),
        "minor_px": (more, 0.0),
    }
    return table.assign(
        **{name: table[name] * factor + add for name, (factor, add) in moved.items() if name in table}
    )


def neutral_learnt(learnt: Learnt, made: Generalised) -> Learnt:
    """A calibration from another flight for a generalised one, without that flight's name and fingerprint."""
    data = learnt.model_dump(exclude_none=True)
    clock = beside_zone(learnt.learnt_on.camera_offset_s)
    nobody = {"flight": "another", "source": "poses", "fingerprint": _NOBODY, "camera_offset_s": clock}
    data["learnt_on"] |= nobody
    camera = made.flight.manifest.camera
    data["camera"] = {**data["camera"], "name": "camera"} if camera is None else camera.model_dump()
    scale_pixels(data["noise"], made.pixels)
    more = [made.pixels if one.unit == "px" else 1.0 for one in learnt.parameter]
    for one, factor in zip(data["parameter"], more, strict=True):
        one |= {key: one[key] * factor for key in ("value", "low", "high")}
    data["covariance"] = tuple(map(tuple, np.array(learnt.covariance) * np.outer(more, more))) if more else ()
    return Learnt.model_validate(data)


def _flown(flight: Flight) -> Array:
    """Known positions (N, 3) in n: of the aircraft, else of whatever has any."""
    tables = [*flight.nav.values(), *(flight.tables[name] for name in ("gnss",) if name in flight.tables)]
    if not tables and flight.truth is not None:
        tables = [flight.truth]
    p = [table[POSITION].to_numpy(float) for table in tables]
    whole = np.concatenate(p) if p else np.empty((0, 3))
    return np.asarray(whole[np.isfinite(whole).all(axis=1)])


def _poses(flight: Flight) -> pd.DataFrame | None:
    """The poses that move the inertial samples: those with the most rows."""
    over_time = [nav for nav in flight.nav.values() if "frame_id" not in nav]
    return max(over_time, key=len, default=None)


def _moved(table: pd.DataFrame, shift: Array, start: float) -> pd.DataFrame:
    """Coordinates from the new origin, stamps from the first one."""
    changed = {
        column: table[column] - float(by)
        for columns in _PLACES
        for column, by in zip(columns, shift, strict=True)
        if column is not None and column in table
    }
    if "time_s" in table:
        changed["time_s"] = table["time_s"] - start
    return table.assign(**changed)


def _date(manifest: Manifest, began: float, treatment: Treatment) -> tuple[datetime | None, str]:
    """The epoch of the copy, and the date in words."""
    if manifest.time.epoch is None:
        return None, ""
    true = datetime.fromtimestamp(manifest.time.epoch.timestamp() + began, UTC)
    day = true.day if treatment.date == "day" else 1
    words = f"{true:%B %Y} (UTC)"
    return datetime(
        true.year, true.month, day, tzinfo=UTC
    ), f"{day} {words}" if treatment.date == "day" else words


def _manifest(
    manifest: Manifest, names: Names, clocks: dict[str, float], name: str, pixels: float
) -> dict[str, Any]:
    """The parts of the manifest that say how, not where, when or who. What is not named here is left out."""
    parts: dict[str, Any] = {
        key: getattr(manifest, key).model_dump(exclude_none=True)
        for key in ("mount", "imu", "gnss", "uncertainty", "scoring", "targets")
    }
    neutral_hulls(parts["targets"])
    for part in ("imu", "gnss"):
        parts[part] |= {"name": "", "note": ""}
    parts["uncertainty"]["note"] = ""
    scale_pixels(parts["uncertainty"], pixels)
    if manifest.terrain is not None:
        # The sides of a map's cells in metres tell its latitude, its reference tells the zone.
        parts["terrain"] = manifest.terrain.model_dump(exclude_none=True) | {
            "source": "map", "sha256": _NOBODY, "crs": "n", "added_m": 0.0,
            "cell_m": (manifest.terrain.step_m, manifest.terrain.step_m),
        }  # fmt: skip
    parts["sensors"] = {
        names.of("sensor", key): _sensor(part, pixels) for key, part in manifest.sensors.items()
    }
    if manifest.twin is not None:
        # That nobody flew it stays; its parameters and its seed would make it again, with its place.
        parts["twin"] = {"name": "twin", "seed": 0}
    return parts | {
        "name": name,
        "kind": manifest.kind,
        "locations": {"sensitivity": "withheld"},
        "platform": {"name": "aircraft"},
        "clocks": {**clocks, "camera_set": manifest.clocks.camera_set},
    }


def _sensor(part: SensorPart, pixels: float) -> dict[str, Any]:
    data = part.model_dump(exclude_none=True, exclude_unset=True)
    scale_pixels(data.get("noise", {}), pixels)
    return data


def list_removals(flight: Flight, made: Flight, names: Names) -> list[str]:
    """What is gone of the manifest and the tables: what it was, and what stands in its place.

    Parameters
    ----------
    flight, made
        The true one and its generalised copy.
    names
        Neutral names by the true ones.
    """
    true = flight.manifest.model_dump(mode="json", exclude_none=True)
    true["sensors"] = {names.of("sensor", name): part for name, part in true.get("sensors", {}).items()}
    stated = dict(_leaves(made.manifest.model_dump(mode="json", exclude_none=True)))
    lines = [
        f"{field}: {value!r} -> {'left out' if stated.get(field, '') == '' else stated[field]}"
        for field, value in _leaves(true)
        if value != "" and stated.get(field) != value
    ]
    lines += [f"table {key}: left out" for key in sorted({*flight.tables} - {*made.tables})]
    tables = {**{f"nav/{name}": nav for name, nav in flight.nav.items()}, **flight.tables}
    for name, table in tables.items():
        copied = _copied(made, name, flight)
        gone = [] if copied is None else [one for one in table if one not in copied]
        lines += [f"column {name}.{one}: left out" for one in gone]
    lines += [] if flight.folder is None else [f"folder: {str(flight.folder.resolve())!r} -> left out"]
    return [*lines, *_renames(names)]


def _leaves(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Whatever is stated, with where."""
    if isinstance(value, Mapping | list):
        for key, one in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield from _leaves(one, f"{place}.{key}" if place else str(key))
    else:
        yield place, value


def _copied(made: Flight, name: str, flight: Flight) -> pd.DataFrame | None:
    if not name.startswith("nav/"):
        return made.tables.get(name)
    return list(made.nav.values())[list(flight.nav).index(name.removeprefix("nav/"))]


def _renames(names: Names) -> Iterator[str]:
    for kind, known in sorted(names.by_kind.items()):
        many = kind in ("frame", "detection")
        for true, neutral in list(known.items())[: 1 if many else None]:
            yield f"{kind}: {true!r} -> {neutral}" + (f", and {len(known) - 1} more" if many else "")
