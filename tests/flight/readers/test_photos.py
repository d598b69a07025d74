"""Folders of images: what their headers say, whatever the maker, and what is said where they say nothing."""

import math
import struct
import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags, Image
from scipy.spatial.transform import Rotation

from tests.flight.readers import made_up_photos as made
from tests.flight.readers.tracks import near
from wildlab.flight.readers import photos, read_folder
from wildlab.flight.readers.log import RawLog
from wildlab.flight.readers.photos import camera_of, from_nadir, is_photos

NOON = datetime(2024, 6, 12, 11, 30, tzinfo=UTC).timestamp()


def read_photos(folder: Path, zone: str | None = None) -> RawLog:
    return read_folder(folder, "photos", zone)[0]


def photo(folder: Path, zone: str | None = None, name: str = "a.jpg", **what: Any) -> dict[str, Any]:
    """The columns of the one image of a folder, as numbers and texts."""
    made.write(folder, name, **what)
    log = read_photos(folder, zone)
    assert [len(part) for part in log.parts.values()] == [1]
    return {name: values[0] for name, values in log.parts["photos"].columns.items()}


def column(log: RawLog, name: str) -> list[Any]:
    return list(log.parts["photos"].columns[name])


def test_what_a_dji_says(tmp_path):
    for number in (10, 9, 1):
        made.write(tmp_path, f"DJI_{number}.JPG", **made.dji(number))
    assert is_photos(tmp_path)
    log = read_photos(tmp_path)
    columns = log.parts["photos"].columns
    assert column(log, "file") == ["DJI_1.JPG", "DJI_9.JPG", "DJI_10.JPG"]
    near(columns, latitude_deg=61.5, longitude_deg=-15.25, height_sea_m=345.5, height_home_m=80.0)
    near(columns, roll_deg=-1.2, pitch_deg=3.4, yaw_deg=139.1)
    near(columns, roll_world_deg=0.0, pitch_world_deg=-89.9, yaw_world_deg=140.7)
    near(columns, width_px=40.0, height_px=30.0)
    near(columns, time_log_s=NOON + np.array([1, 9, 10]), use=1)
    assert "height_ellipsoid_m" not in columns
    assert column(log, "camera") == ["DJI FC6310"] * 3


def test_rtk_has_its_height_above_the_ellipsoid_its_spread_and_fix(tmp_path):
    rtk = {"RtkFlag": 50, "RtkStdLat": 0.03, "RtkStdLon": 0.04, "RtkStdHgt": 0.05}
    more = {"GpsLatitude": "61.123456789", "GpsLongtitude": "-15.987654321"}
    row = photo(tmp_path, **made.dji(1, CalibratedFocalLength="3666.67", **rtk, **more))
    near(row, height_ellipsoid_m=345.5, fix=6, sd_horizontal_m=math.hypot(0.03, 0.04) / math.sqrt(2))
    # The maker's own digits, its misspelt tag too, are more than those of EXIF.
    near(row, sd_vertical_m=0.05, latitude_deg=61.123456789, longitude_deg=-15.987654321)
    camera, how = camera_of(read_photos(tmp_path))
    assert camera.fx_px == 3666.67 and "calibrated by the maker" in how


@given(
    st.floats(-89, 89),
    st.floats(-179, 179),
    st.sampled_from([(0, 1, "sea"), (1, -1, "sea"), (2, 1, "ellipsoid")]),
)
def test_hemispheres_and_sides_of_heights(latitude, longitude, side):
    gps = made.gps_of(latitude, longitude, 12.5, ref=side[0])
    tags = photos.Tags(exif={ExifTags.GPSTAGS[number]: value for number, value in gps.items()})
    found = photos.place_of(tags)
    if abs(latitude) + abs(longitude) > 1e-6:
        assert found[:2] == pytest.approx((latitude, longitude), abs=1e-9)
    heights = dict(zip(("ellipsoid", "sea", "home"), photos.heights_of(tags), strict=True))
    assert heights[side[2]] == 12.5 * side[1]
    assert sum(map(math.isfinite, heights.values())) == 1


def test_zones_and_parts_of_seconds(tmp_path):
    own = {0x9003: "2024:06:12 11:30:05", 0x9291: "25", 0x9011: "+02:00"}
    row = photo(tmp_path, exif=made.exif_of(own=own, gps=made.gps_of(61, 15, 9)))
    near(row, 1e-6, time_s=NOON + 5.25 - 7200)
    assert read_photos(tmp_path).clock == "zones that the images state"


def test_a_camera_beside_gps_time(tmp_path):
    """A camera three seconds and two hours off, with parts of seconds; GPS cuts them off."""
    wall = NOON + 3.4 + 2.5 * np.arange(6)
    for number, at in enumerate(wall):
        whole, sky = (datetime.fromtimestamp(int(one), UTC) for one in (at, at - 7203))
        own = {0x9003: f"{whole:%Y:%m:%d %H:%M:%S}", 0x9291: f"{at % 1:.3f}"[2:]}
        clock = (float(sky.hour), float(sky.minute), float(sky.second))
        gps = made.gps_of(61, 15, 9, date=f"{sky:%Y:%m:%d}", clock=clock)
        made.write(tmp_path, f"{number}.jpg", exif=made.exif_of(own=own, gps=gps))
    log = read_photos(tmp_path)
    time = np.array(column(log, "time_s"))
    assert np.diff(time) == pytest.approx([2.5] * 5, abs=1e-6)
    assert np.abs(time - (wall - 7203)).max() <= 1.0
    assert log.clock == "GPS time of the images"


def test_the_makers_own_utc_goes_before_a_stamp_of_gps(tmp_path):
    row = photo(tmp_path, **made.dji(1, UTCAtExposure="2024-06-12T09:30:01.123456"))
    near(row, 1e-5, time_s=NOON - 7200 + 1.123456)


def test_parrots_and_pix4ds_tags(tmp_path):
    pix4d = {"Camera:Yaw": "45", "Camera:Pitch": "60", "Camera:Roll": "0", "Camera:GPSXYAccuracy": "3/2"}
    tags = {
        "CameraRoll": 0,
        "CameraPitch": -30,
        "CameraYaw": 45,
        "DroneRoll": 1,
        "DronePitch": 2,
        "DroneYaw": 3,
    }
    anafi = {f"drone-parrot:{name}Degree": value for name, value in tags.items()}
    for model, space, found in (("Sequoia", made.PIX4D, pix4d), ("Anafi", made.PARROT, anafi)):
        exif = made.exif_of({0x010F: "Parrot", 0x0110: model}, gps=made.gps_of(47.0, 8.5, 500.0))
        made.write(tmp_path, f"{space[6:9]}.jpg", exif=exif, xmp=made.xmp_of(space, found))
    log = read_photos(tmp_path)
    near(log.parts["photos"].columns, roll_world_deg=0.0, pitch_world_deg=-30.0, yaw_world_deg=45.0)
    assert column(log, "roll_deg")[1] == 1.0
    assert column(log, "sd_horizontal_m")[0] == 1.5
    assert "2 cameras: Parrot" in camera_of(log)[1]


@given(st.floats(-180, 180), st.floats(-89, 89), st.floats(-180, 180))
def test_angles_from_nadir_are_the_same_rotation(roll, pitch, yaw):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of angles that are not unique
        down = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).as_matrix()
        ahead = Rotation.from_euler("ZYX", from_nadir(roll, pitch, yaw)[::-1], degrees=True).as_matrix()
    # The optical axis, right and down in the image, in both ways to say them.
    assert ahead[:, 0] == pytest.approx(down[:, 2], abs=1e-6)
    assert ahead[:, 1] == pytest.approx(down[:, 1], abs=1e-6)
    assert ahead[:, 2] == pytest.approx(-down[:, 0], abs=1e-6)


@pytest.mark.parametrize("more", [{}, {"DewarpFlag": 1}])
def test_the_makers_calibration_goes_before_its_design(tmp_path, more):
    data = "2018-09-04;3678.87,3671.84,10.1,27.29,-0.268652,0.114663,0.0000152,-0.000046,-0.0350261"
    row = photo(tmp_path, **made.dji(1, DewarpData=data, CalibratedFocalLength="3666.666504", **more))
    near(row, focal_px=math.sqrt(3678.87 * 3671.84))


def test_focal_length_by_the_equivalent_over_the_diagonal(tmp_path):
    exif = made.exif_of(own={0x920A: 9.1, 0xA405: 40})
    for name in ("DJI_1_T.JPG", "DJI_2_T.JPG"):
        made.write(tmp_path, name, size=(640, 512), exif=exif)
    camera, how = camera_of(read_photos(tmp_path))
    # 9.1 mm with pixels of 12 um, which no tag says.
    assert camera.fx_px == pytest.approx(9.1 / 0.012, rel=0.01)
    assert "rounded to within 1 %" in how


@pytest.mark.parametrize(
    ("x", "y", "unit", "focal"),
    [
        (100.0, 100.0, 4, 1300.0),  # 10 um, by the standard
        (2540.0, 2540.0, 2, 1300.0),  # in inches
        (10.88, 8.704, 4, 764.706),
        (10.0, 3.0, 4, math.nan),  # neither square pixels nor a sensor of this form
    ],
)
def test_focal_length_by_the_sensor(tmp_path, x, y, unit, focal):
    own = {0x920A: 13.0, 0xA20E: x, 0xA20F: y, 0xA210: unit}
    row = photo(tmp_path, size=(640, 512), exif=made.exif_of(own=own))
    assert row["focal_px"] == pytest.approx(focal, rel=1e-5, nan_ok=True)


@pytest.mark.parametrize(
    ("sizes", "film", "problem"),
    [((40, 40), (24, 48), "the lens zooms"), ((40, 60), (24, 24), "2 cameras: One")],
)
def test_a_zoom_and_two_sizes_are_no_one_camera(tmp_path, sizes, film, problem):
    for number, (size, equivalent) in enumerate(zip(sizes, film, strict=True)):
        exif = made.exif_of({0x0110: "One"}, {0xA405: equivalent})
        made.write(tmp_path, f"{number}.jpg", size=(size, 30), exif=exif)
    camera, how = camera_of(read_photos(tmp_path))
    assert camera is None and problem in how


def test_tags_in_png_and_tiff(tmp_path):
    exif = made.exif_of({0x010F: "Cam"}, {0x9003: "2024:06:12 11:30:05"}, made.gps_of(-12.25, 34.5, 56.0))
    Image.new("L", (12, 8)).save(tmp_path / "a.png", exif=exif)
    (tmp_path / "b.tif").write_bytes(made.tiff(exif))
    columns = read_photos(tmp_path).parts["photos"].columns
    near(columns, latitude_deg=[-12.25] * 2, time_log_s=NOON + 5, height_sea_m=56.0)


# -- images of real cameras


def test_an_xt2_by_what_is_known_of_it(shared_data):
    log = read_photos(shared_data("imagery", "deervision_rjpeg"))
    (camera, _), columns = camera_of(log), log.parts["photos"].columns
    assert (camera.width_px, camera.height_px) == (640, 512)
    assert camera.fx_px == pytest.approx(764.7, abs=0.05)
    near(columns, 0.5, longitude_deg=-77.5)
    near(columns, 0.2, height_home_m=[100.0] * 4)
    near(columns, 1e-4, pitch_world_deg=-89.9)


def test_xmp_that_is_no_xml_any_more_is_read_as_far_as_it_goes(tmp_path):
    whole = made.dji(1)["xmp"]
    cut = whole[: whole.find(b"drone-dji:FlightRollDegree")]
    undeclared = whole.replace(made.DJI.encode(), b"")
    for number, packet in enumerate((cut + b">", undeclared)):
        made.write(tmp_path, f"{number}.jpg", xmp=packet)
    log = read_photos(tmp_path)
    assert column(log, "pitch_world_deg") == [-89.9] * 2


def test_a_claim_of_ten_gigabytes_is_not_believed(tmp_path):
    # A tag of EXIF that claims as much, a TIFF with such a tag, and a PNG of as many pixels.
    entry = struct.pack("<HHII", 0x010F, 2, 0xFFFFFFF0, 26)
    tiff = b"II*\0" + struct.pack("<IH", 8, 1) + entry + struct.pack("<I", 0) + b"abc"
    (tmp_path / "a.jpg").write_bytes(made.jpeg(more=made.segment(0xE1, b"Exif\0\0" + tiff)))
    (tmp_path / "b.tif").write_bytes(tiff)
    head = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    (tmp_path / "c.png").write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + b"\0\0\0\0")
    (tmp_path / "d.jpg").write_bytes(b"\xff\xd8\xff\xe1\xff\xff" + b"Exif\0\0" + tiff)
    (tmp_path / "e.jpg").write_bytes(b"")
    log = read_photos(tmp_path)
    assert column(log, "use") == [0.0] * 5


def test_cut_and_spoilt_images_end_in_no_traceback(tmp_path):
    whole = made.jpeg(**made.dji(1, RtkFlag=50, UTCAtExposure="2024-06-12T09:30:01.123456"))
    random = np.random.default_rng(14)
    for number, data in enumerate((whole, made.tiff(made.dji(1)["exif"]))):
        folder = tmp_path / str(number)
        folder.mkdir()
        ending = ("jpg", "tif")[number]
        head = len(data) if number else data.find(b"\xff\xda")
        for place in random.integers(0, head, 50):
            (folder / f"cut{place}.{ending}").write_bytes(data[:place])
        for at in range(50):
            spoilt = np.frombuffer(data, np.uint8).copy()
            spoilt[random.integers(0, head, 100 if at % 2 else 3)] = random.integers(0, 256, 1)
            (folder / f"flip{at}.{ending}").write_bytes(spoilt.tobytes())
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            log = read_photos(folder)
        part = log.parts["photos"]
        for name in ("latitude_deg", "longitude_deg"):
            assert np.isfinite(part.columns[name][part.used]).all()
        assert log.lost
