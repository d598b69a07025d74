"""Wrong meanings of pixels, calibration and mount: see `sabotage`."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd
import pymap3d
from scipy.spatial.transform import Rotation

from tests.flight.checks import sabotage as s
from wildlab.flight.store import Flight


def camera_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    camera, mount = flight.manifest.camera, flight.manifest.mount
    assert camera is not None
    width, height = camera.width_px, camera.height_px

    def one(name: str, change: s.Change, named: str) -> s.WrongMeaning:
        return s.WrongMeaning(f"camera: {name}", change, named)

    other = "forward" if mount.looks == "down" else "down"
    yield one(
        "looks the other way", lambda f: s.manifest_of(f, mount={"looks": other}), f'looks = "{mount.looks}"'
    )
    for key in ("pan", "tilt", "roll"):
        for turn in (90.0, -90.0, 180.0):
            yield one(
                f"mount turned, {key} {turn:g} deg",
                lambda f, k=key, t=turn: s.manifest_of(
                    f, mount={f"misalignment_{k}_deg": t + getattr(mount, f"misalignment_{k}_deg")}
                ),
                r"\[mount\]|yaw is off|pitch|roll",
            )

    def pixels(change: Callable[[np.ndarray], np.ndarray]) -> s.Change:
        def apply(f: Flight) -> Flight:
            def rows(data: pd.DataFrame) -> pd.DataFrame:
                of = (data["kind"] == "pixel").to_numpy()
                data.loc[of, ["u_px", "v_px"]] = change(data.loc[of, ["u_px", "v_px"]].to_numpy(float))
                return data

            return s.with_table(f, "detections", rows)

        return apply

    yield one("v from the bottom", pixels(lambda uv: uv * [1, -1] + [0, height]), "v counts upwards")
    yield one("u from the right", pixels(lambda uv: uv * [-1, 1] + [width, 0]), "u counts to the left")
    yield one("image upside down", pixels(lambda uv: [width, height] - uv), "upside down|top of the image")
    yield one("u and v exchanged", pixels(lambda uv: uv[:, ::-1]), "u and v are exchanged")
    yield one(
        "pixels of a preview of half the size", pixels(lambda uv: uv / 2), "of an image .* times as large"
    )
    yield one("pixels as proportions", pixels(lambda uv: uv / [width, height]), "proportion")
    yield one("pixels from the centre", pixels(lambda uv: uv - [width / 2, height / 2]), "from the centre")
    f_mm = 7.5
    yield one(
        "focal length in mm",
        lambda f: s.manifest_of(f, camera={"fx_px": f_mm, "fy_px": f_mm}),
        "millimetres|mm",
    )
    for factor in (0.5, 2.0):
        yield one(
            f"focal length times {factor:g}",
            lambda f, k=factor: s.manifest_of(
                f, camera={"fx_px": k * camera.fx_px, "fy_px": k * camera.fy_px}
            ),
            "focal length",
        )
        yield one(
            f"calibration of another size, times {factor:g}",
            lambda f, k=factor: s.manifest_of(
                f, camera={n: k * getattr(camera, n) for n in ("fx_px", "fy_px", "cx_px", "cy_px")}
            ),
            "times as large",
        )
    yield one(
        "cx and cy exchanged",
        lambda f: s.manifest_of(f, camera={"cx_px": camera.cy_px, "cy_px": camera.cx_px}),
        "cx and cy are exchanged|cx_px",
    )
    yield one("principal point 0", lambda f: s.manifest_of(f, camera={"cx_px": 0.0, "cy_px": 0.0}), "cx_px")
    yield one(
        "width and height exchanged",
        lambda f: s.manifest_of(f, camera={"width_px": height, "height_px": width}),
        "width|size of the image",
    )
    lens = ("k1", "k2", "p1", "p2", "k3")
    if any(getattr(camera, n) for n in lens):
        yield one(
            "sign of the distortion",
            lambda f: s.manifest_of(f, camera={n: -getattr(camera, n) for n in lens}),
            "distortion",
        )
        yield one("sign of k1", lambda f: s.manifest_of(f, camera={"k1": -camera.k1}), "k1|distortion")
        yield one(
            "distortion left out", lambda f: s.manifest_of(f, camera={n: 0.0 for n in lens}), "distortion"
        )
        yield one(
            "order k1, k2, k3, p1, p2",
            lambda f: s.manifest_of(f, camera={"p1": camera.k3, "p2": camera.p1, "k3": camera.p2}),
            "order|distortion",
        )
    else:
        yield one(
            "distortion of another lens", lambda f: s.manifest_of(f, camera={"k1": -0.4}), "k1|distortion"
        )
    yield one(
        "lever arm in mm", lambda f: s.manifest_of(f, mount={"lever_arm_m": (120.0, 0.0, 80.0)}), "lever arm"
    )
    yield one("one photo off", _one_photo, "one photo off")
    if flight.truth is not None:
        yield one("one mark off by 25 m", _one_mark, "one mark off")
        yield one("marks named one along", _marks_along, "names")
    yield one("ground heights 50 m up", _ground, "ground")
    origin = flight.manifest.origin
    yield s.WrongMeaning("origin 200 km away", lambda f: _far(f, origin.latitude_deg + 1.8), "origin")


def _far(flight: Flight, latitude: float) -> Flight:
    """Another origin: the places are about the new one, the attitudes as they were read."""
    o = flight.manifest.origin
    old, new = (o.latitude_deg, o.longitude_deg, o.height_m), (latitude, o.longitude_deg, o.height_m)

    def rows(data: pd.DataFrame) -> pd.DataFrame:
        there = pymap3d.ned2geodetic(*data[s.NED].to_numpy(float).T, *old)
        data[s.NED] = np.column_stack(pymap3d.geodetic2ned(*there, *new))
        return data

    for name in flight.nav:
        flight = s.with_table(flight, f"nav/{name}", rows)
    for name in ("gnss", "truth"):
        if name in flight.tables:
            flight = s.with_table(flight, name, rows)
    return s.manifest_of(flight, origin={"latitude_deg": latitude})


def _one_photo(flight: Flight) -> Flight:
    """A photo with marks gets the attitude of half a turn later."""
    detections = flight.table("detections")
    marks = detections[detections["target_id"] != ""] if "target_id" in detections else detections
    frame = marks["frame_id"].value_counts().index[0]

    def rows(data: pd.DataFrame) -> pd.DataFrame:
        if "frame_id" in data:
            which = (data["frame_id"] == frame).to_numpy()
        else:
            at = float(flight.table("frames").set_index("frame_id").loc[frame, "time_s"])
            which = (
                np.abs(data["time_s"] + flight.manifest.clocks.camera_offset_s * 0 - at) < 1.0
            ).to_numpy()
        q = Rotation.from_quat(data.loc[which, s.QUATERNION].to_numpy(float), scalar_first=True)
        turn = Rotation.from_euler("Z", 60, degrees=True)
        data.loc[which, s.QUATERNION] = (turn * q).as_quat(scalar_first=True, canonical=True)
        return data

    for name in flight.nav:
        flight = s.with_table(flight, f"nav/{name}", rows)
    return flight


def _one_mark(flight: Flight) -> Flight:
    detections = flight.table("detections")
    names = detections.get("target_id", pd.Series(dtype=object))
    counted = names[names != ""].value_counts()
    mark = counted.index[0] if len(counted) else flight.table("truth")["target_id"].iloc[0]

    def rows(data: pd.DataFrame) -> pd.DataFrame:
        data.loc[data["target_id"] == mark, "north_m"] += 25.0
        return data

    return s.with_table(flight, "truth", rows)


def _marks_along(flight: Flight) -> Flight:
    def rows(data: pd.DataFrame) -> pd.DataFrame:
        names = list(dict.fromkeys(data["target_id"]))
        data["target_id"] = data["target_id"].map(dict(zip(names, names[1:] + names[:1], strict=True)))
        return data

    return s.with_table(flight, "truth", rows)


def _ground(flight: Flight) -> Flight:
    def rows(data: pd.DataFrame) -> pd.DataFrame:
        if "plane_down_m" in data:
            data["plane_down_m"] = data["plane_down_m"] - 50.0
        return data

    return s.with_table(flight, "detections", rows)
