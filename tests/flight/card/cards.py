"""Memory cards for tests: images whose pixels are known by an independent projection, and tracks."""

import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pymap3d

from tests.flight.readers.made_up_photos import DJI, exif_of, jpeg, xmp_of

#: The corner of the world that all of it is in, deg and m above the ellipsoid.
LATITUDE, LONGITUDE, GROUND = 59.05, 10.12, 40.0
WIDTH, HEIGHT, FOCAL = 640, 512, 800.0
#: By clock time of the camera, UTC.
TAKEN = datetime(2026, 5, 1, 8, 0, 0, tzinfo=UTC)
MARKS = {"north-west": (20.0, -15.0), "pole": (5.0, 12.0), "=HYPERLINK(1)": (-18.0, 3.0)}


def geodetic(north: float, east: float) -> tuple[float, float]:
    """Latitude and longitude of a point so far from the corner, level with it."""
    lat, lon, _ = pymap3d.ned2geodetic(
        np.array([north]), np.array([east]), np.zeros(1), LATITUDE, LONGITUDE, GROUND
    )
    return float(lat[0]), float(lon[0])


def pixel_of(
    mark: tuple[float, float], camera: tuple[float, float, float], roll: float, pitch: float, yaw: float
) -> tuple[float, float]:
    """Pixel of a point on the ground (m north and east of the corner) by spherical trigonometry alone: the
    axis, what is right of it and what is below it, of a camera at (north, east, up) m; degrees."""
    cy, sy, cp, sp = (f(math.radians(a)) for a in (yaw, pitch) for f in (math.cos, math.sin))
    ahead = np.array([cp * cy, cp * sy, -sp])
    right = np.array([-sy, cy, 0.0])
    below = np.cross(ahead, right)
    cr, sr = math.cos(math.radians(roll)), math.sin(math.radians(roll))
    right, below = cr * right + sr * below, cr * below - sr * right
    lat, lon = geodetic(*mark)
    c_lat, c_lon, c_h = place(camera)
    to = np.array(pymap3d.geodetic2ned(lat, lon, GROUND, c_lat, c_lon, c_h))
    depth = to @ ahead
    return (
        float((WIDTH - 1) / 2 + FOCAL * (to @ right) / depth),
        float((HEIGHT - 1) / 2 + FOCAL * (to @ below) / depth),
    )


def place(camera: tuple[float, float, float]) -> tuple[float, float, float]:
    """Latitude, longitude and ellipsoidal height of north, east and up of the corner."""
    lat, lon = geodetic(camera[0], camera[1])
    return lat, lon, GROUND + camera[2]


def write_photo(
    path: Path,
    camera: tuple[float, float, float],
    angles: tuple[float, float, float],
    when: datetime,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    focal: float = FOCAL,
) -> None:
    """A JPEG with what a drone with RTK writes into it."""
    lat, lon, height = place(camera)
    values = {"GpsLatitude": f"{lat:.9f}", "GpsLongitude": f"{lon:.9f}", "AbsoluteAltitude": f"{height:+.3f}"}
    values |= {"RelativeAltitude": f"{camera[2]:+.3f}", "CalibratedFocalLength": f"{focal:.3f}"}
    values |= {"RtkFlag": 50, "RtkStdLon": 0.01, "RtkStdLat": 0.01, "RtkStdHgt": 0.02}
    turns = zip(("Roll", "Pitch", "Yaw"), angles, strict=True)
    values |= {f"Gimbal{axis}Degree": f"{angle:+.2f}" for axis, angle in turns}
    own = {36867: f"{when:%Y:%m:%d %H:%M:%S}", 37521: f"{when.microsecond // 1000:03d}"}
    exif = exif_of({271: "DJI", 272: "FC6310R"}, own)
    xmp = xmp_of(DJI, {f"drone-dji:{name}": value for name, value in values.items()})
    path.write_bytes(jpeg(size, exif, xmp))


def write_card(folder: Path) -> None:
    """A card: images, a table of surveyed points and one of clicks."""
    pictures = folder / "DCIM" / "100MEDIA"
    pictures.mkdir(parents=True)
    rows = ["image,name,u,v"]
    for i in range(4):
        camera = (-30.0 + 4 * i, -8.0 + 5 * i, 60.0 + i)
        angles = (0.0, -60.0 - 5 * i, 10.0 + 7 * i)
        name = f"DJI_{i + 1:04d}.JPG"
        when = datetime.fromtimestamp(TAKEN.timestamp() + 2.5 * i, UTC)
        write_photo(pictures / name, camera, angles, when)
        for mark, where in MARKS.items():
            u, v = pixel_of(where, camera, *angles)
            if 0 <= u < WIDTH and 0 <= v < HEIGHT:
                rows.append(f"{name},{mark},{u:.4f},{v:.4f}")
    (folder / "clicks.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    lines = ["name;latitude;longitude;height ellipsoid"]
    for mark, (north, east) in MARKS.items():
        lat, lon = geodetic(north, east)
        lines.append(f"{mark};{lat:.10f};{lon:.10f};{GROUND:.3f}")
    (folder / "marks.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def gpx(points: list[tuple[float, float, float, float]]) -> str:
    """GPX of (seconds since `TAKEN`, north, east, height) of the corner."""
    lines = ['<?xml version="1.0"?><gpx version="1.1" creator="t" xmlns="http://www.topografix.com/GPX/1/1">']
    lines.append("<trk><trkseg>")
    for t, north, east, up in points:
        lat, lon = geodetic(north, east)
        at = datetime.fromtimestamp(TAKEN.timestamp() + t, UTC).isoformat().replace("+00:00", "Z")
        lines.append(f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><ele>{up:.2f}</ele><time>{at}</time></trkpt>')
    return "\n".join([*lines, "</trkseg></trk></gpx>"])
