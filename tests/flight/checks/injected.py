"""The usual mistakes, made in sound flights: what a finding has to say to have named each of them."""

from __future__ import annotations

import numpy as np

from tests.flight.checks import sabotage
from tests.flight.checks.sabotage import Change, WrongMeaning
from wildlab.flight.store import Flight


def injected_mistakes(flight: Flight) -> list[WrongMeaning]:
    """Those that change something in this flight, in the poses of its camera or else its only ones."""
    source = flight.manifest.mount.poses or next(iter(flight.nav))
    table, camera = f"nav/{source}", flight.manifest.camera
    timed = "frame_id" not in flight.nav[source]
    found = [WrongMeaning(name, change, named) for name, change, named in _attitudes(table)]
    found += [
        one
        for one in sabotage.places(table, "poses")
        if one.name.split(": ")[1] in ("height in feet", "north negated")
    ]
    if camera is not None:
        size = {name: 1000 * getattr(camera, name) for name in ("fx_px", "fy_px")}
        other = "forward" if flight.manifest.mount.looks == "down" else "down"
        found += [
            WrongMeaning(
                "focal length x 1000", lambda f: sabotage.manifest_of(f, camera=size), "focal length"
            ),
            WrongMeaning(
                "camera looks the other way",
                lambda f: sabotage.manifest_of(f, mount={"looks": other}),
                f'looks = "{flight.manifest.mount.looks}"|\\[mount\\]',
            ),
        ]
        if timed:
            found += [
                WrongMeaning(f"images {s:g} s late", sabotage.shift("frames", s), "camera_offset_s|18 s")
                for s in (3.0, 18.0)
            ]
    if timed:
        found += [
            WrongMeaning(f"poses {s:g} s late", sabotage.shift(table, s), "offset_s|leap seconds|the time in")
            for s in (3.0, 18.0)
        ]
    if flight.gnss is not None:
        found.append(WrongMeaning("gnss 18 s late", sabotage.shift("gnss", 18.0), "gnss_offset_s"))
    if flight.imu is not None:
        found.append(
            WrongMeaning(
                "rate in deg/s",
                sabotage.columns("imu", sabotage.RATE, np.eye(3) * np.degrees(1)),
                "deg/s",
            )
        )
    return found


def _attitudes(table: str) -> list[tuple[str, Change, str]]:
    euler = sabotage._euler
    return [
        ("roll and pitch exchanged", euler(table, lambda e: e[:, [1, 0, 2]]), "roll and pitch are exchanged"),
        ("yaw negated", euler(table, lambda e: e * [1, 1, -1]), "yaw has the wrong sign|yaw"),
        ("yaw from east", euler(table, lambda e: e * [1, 1, -1] + [0, 0, 90]), "to the left from east|yaw"),
        ("angles in deg read as rad", euler(table, np.degrees), "in degrees|degrees, and the recipe"),
        ("angles in rad read as deg", euler(table, np.radians), "radians"),
    ]
