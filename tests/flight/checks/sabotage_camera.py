"""Wrong meanings of pixels, calibration and mount: see `sabotage`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
import pymap3d
from scipy.spatial.transform import Rotation

from tests.flight.checks import sabotage as s
from wildlab.flight.store import Flight


def camera_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    for name, change in {**_pixels(flight), **_calibration(flight), **_mount(flight)}.items():
        yield s.WrongMeaning(f"camera: {name}", change)
    yield s.WrongMeaning("camera: one photo off", _one_photo)
    if flight.truth is not None:
        yield s.WrongMeaning("camera: one mark off by 25 m", lambda f: s.with_table(f, "truth", _one_mark))
        yield s.WrongMeaning("camera: marks named one along", lambda f: s.with_table(f, "truth", _along))
    yield s.WrongMeaning("camera: ground heights 50 m up", _ground)
    yield s.WrongMeaning("origin 200 km away", lambda f: _far(f, f.manifest.origin.latitude_deg + 1.8))


def _pixels(flight: Flight) -> dict[str, s.Change]:
    camera = flight.manifest.camera
    assert camera is not None
    size = np.array([camera.width_px, camera.height_px])

    def pixels(change: Callable[[np.ndarray], np.ndarray]) -> s.Change:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            of = (data["kind"] == "pixel").to_numpy()
            data.loc[of, ["u_px", "v_px"]] = change(data.loc[of, ["u_px", "v_px"]].to_numpy(float))
            return data

        return lambda f: s.with_table(f, "detections", rows)

    return {
        "v from the bottom": pixels(lambda uv: uv * [1, -1] + size * [0, 1]),
        "u from the right": pixels(lambda uv: uv * [-1, 1] + size * [1, 0]),
        "image upside down": pixels(lambda uv: size - uv),
        "u and v exchanged": pixels(lambda uv: uv[:, ::-1]),
        "pixels of a preview of half the size": pixels(lambda uv: uv / 2),
        "pixels as proportions": pixels(lambda uv: uv / size),
        "pixels from the centre": pixels(lambda uv: uv - size / 2),
    }


def _calibration(flight: Flight) -> dict[str, s.Change]:
    camera = flight.manifest.camera
    assert camera is not None

    def stated(**values: Any) -> s.Change:
        return lambda f: s.manifest_of(f, camera=values)

    def times(factor: float, *names: str) -> s.Change:
        return stated(**{name: factor * getattr(camera, name) for name in names})

    focal, centre, lens = ("fx_px", "fy_px"), ("cx_px", "cy_px"), ("k1", "k2", "p1", "p2", "k3")
    found = {"focal length in mm": stated(fx_px=7.5, fy_px=7.5)}
    for factor in (0.5, 2.0):
        found[f"focal length times {factor:g}"] = times(factor, *focal)
        found[f"calibration of another size, times {factor:g}"] = times(factor, *focal, *centre)
    found["cx and cy exchanged"] = stated(cx_px=camera.cy_px, cy_px=camera.cx_px)
    found["principal point 0"] = stated(cx_px=0.0, cy_px=0.0)
    found["width and height exchanged"] = stated(width_px=camera.height_px, height_px=camera.width_px)
    if not any(getattr(camera, name) for name in lens):
        return {**found, "distortion of another lens": stated(k1=-0.4)}
    return {
        **found,
        "sign of the distortion": times(-1.0, *lens),
        "sign of k1": times(-1.0, "k1"),
        "distortion left out": times(0.0, *lens),
        "order k1, k2, k3, p1, p2": stated(p1=camera.k3, p2=camera.p1, k3=camera.p2),
    }


def _mount(flight: Flight) -> dict[str, s.Change]:
    mount = flight.manifest.mount

    def stated(**values: Any) -> s.Change:
        return lambda f: s.manifest_of(f, mount=values)

    found = {"looks the other way": stated(looks="forward" if mount.looks == "down" else "down")}
    for key in ("pan", "tilt", "roll"):
        name = f"misalignment_{key}_deg"
        for turn in (90.0, -90.0, 180.0):
            found[f"mount turned, {key} {turn:g} deg"] = stated(**{name: turn + getattr(mount, name)})
    found["lever arm in mm"] = stated(lever_arm_m=(120.0, 0.0, 80.0))
    return found


def _far(flight: Flight, latitude: float) -> Flight:
    """Another origin: the places are about the new one, the attitudes as they were read."""
    o = flight.manifest.origin
    old, new = (o.latitude_deg, o.longitude_deg, o.height_m), (latitude, o.longitude_deg, o.height_m)

    def moved(p: np.ndarray) -> np.ndarray:
        return np.column_stack(pymap3d.geodetic2ned(*pymap3d.ned2geodetic(*p.T, *old), *new))

    tables = [f"nav/{name}" for name in flight.nav]
    for table in tables + [name for name in ("gnss", "truth") if name in flight.tables]:
        flight = s.of_columns(table, s.NED, moved)(flight)
    return s.manifest_of(flight, origin={"latitude_deg": latitude})


def _one_photo(flight: Flight) -> Flight:
    """The poses at a photo with marks are turned by 60 deg."""
    detections = flight.table("detections")
    marks = detections[detections["target_id"] != ""] if "target_id" in detections else detections
    frame = marks["frame_id"].value_counts().index[0]

    def rows(data: pd.DataFrame) -> pd.DataFrame:
        if "frame_id" in data:
            which = (data["frame_id"] == frame).to_numpy()
        else:
            at = float(flight.table("frames").set_index("frame_id").loc[frame, "time_s"])
            which = (np.abs(data["time_s"] - at) < 1.0).to_numpy()
        q = Rotation.from_quat(data.loc[which, s.QUATERNION].to_numpy(float), scalar_first=True)
        turn = Rotation.from_euler("Z", 60, degrees=True)
        data.loc[which, s.QUATERNION] = (turn * q).as_quat(scalar_first=True, canonical=True)
        return data

    for name in flight.nav:
        flight = s.with_table(flight, f"nav/{name}", rows)
    return flight


def _one_mark(truth: pd.DataFrame) -> pd.DataFrame:
    truth.loc[truth["target_id"] == truth["target_id"].iloc[0], "north_m"] += 25.0
    return truth


def _along(truth: pd.DataFrame) -> pd.DataFrame:
    names = list(dict.fromkeys(truth["target_id"]))
    return truth.assign(
        target_id=truth["target_id"].map(dict(zip(names, names[1:] + names[:1], strict=True)))
    )


def _ground(flight: Flight) -> Flight:
    if "plane_down_m" not in flight.table("detections"):
        return flight
    return s.of_columns("detections", ["plane_down_m"], lambda down: down - 50.0)(flight)
