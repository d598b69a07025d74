"""GPX: values as gpxpy has them, damage, and what no parser may be asked to do."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import gpxpy
import numpy as np
import pytest

from tests.flight.readers.tracks import Reader, check, columns_of, near
from wildlab.errors import WildlabError

gpx = Reader("gpx")

START = datetime(2026, 6, 1, 10, tzinfo=UTC)
SAMPLES = ("around-visnjan-with-car", "cerknicko-jezero", "Mojstrovka", "korita-zbevnica")


def point(k: int, lat: object = None, inside: str | None = None, stamp: object = None) -> str:
    at = (START + timedelta(seconds=k)).strftime("%Y-%m-%dT%H:%M:%SZ") if stamp is None else stamp
    body = f"<ele>{100 + k}</ele><time>{at}</time>" if inside is None else inside
    return f'<trkpt lat="{63 + k * 1e-4 if lat is None else lat}" lon="10.5">{body}</trkpt>'


def document(*segments: str, head: str = "", version: str = "1.1") -> bytes:
    body = "".join(f"<trkseg>{one}</trkseg>" for one in segments)
    return f'{head}<gpx version="{version}" creator="x"><trk><name>n</name>{body}</trk></gpx>'.encode()


def track(count: int = 10) -> str:
    return "".join(map(point, range(count)))


@pytest.mark.parametrize("name", SAMPLES)
def test_equals_gpxpy(name, shared_data):
    path = shared_data("logs", "target_gpx", f"{name}.gpx")
    data = path.read_bytes()
    assert gpx.sniff(data[:8192])
    log = gpx.read(path, data)
    check(log)
    assert not log.lost
    stream = log.parts["gnss"]
    points = [p for t in gpxpy.parse(data.decode()).tracks for s in t.segments for p in s.points]
    assert len(stream) == len(points)
    for row, p in zip(np.argsort(stream.rows), points, strict=True):
        assert stream.columns["latitude_deg"][row] == p.latitude
        assert stream.columns["longitude_deg"][row] == p.longitude
        height = stream.columns["height_sea_m"][row]
        assert np.isnan(height) if p.elevation is None else height == p.elevation
        at = stream.columns["time_s"][row]
        assert np.isnan(at) if p.time is None else at == p.time.timestamp()


def test_segments_newest_first():
    late, early = "".join(map(point, range(50, 60))), "".join(map(point, range(10)))
    log = gpx.read(Path("x.gpx"), document(late, early))
    assert log.parts["gnss"].used.all()
    assert log.parts["gnss"].rows.tolist() == [*range(11, 21), *range(1, 11)]


def test_speed_course_and_quality_of_gpx_1_0():
    inside = "<time>2026-06-01T10:00:0{}Z</time><course>90</course><speed>5</speed>"
    inside += "<geoidheight>40</geoidheight><fix>{}</fix><sat>7</sat><hdop>{}</hdop>"
    cases = [("3d", 1.0), ("none", 1.0), ("dgps", 99.9), ("2d", 1.5)]
    body = "".join(point(k, inside=inside.format(k, *case)) for k, case in enumerate(cases))
    columns = columns_of(gpx, document(body, version="1.0"))
    near(columns, v_east_m_s=5, v_north_m_s=0, undulation_m=40, fix=[3, 0, 4, 2])
    assert columns["why"].tolist() == ["", "no fix", "no dilution of precision", ""]


@pytest.mark.parametrize("codec", ["utf-8-sig", "utf-16", "latin-1"])
def test_encodings_and_line_ends(codec):
    text = document(track()).decode().replace("<name>n</name>", "<name>Sæl =1+1</name>\r\n")
    head = '<?xml version="1.0" encoding="ISO-8859-1"?>\r\n' if codec == "latin-1" else ""
    data = (head + text).encode(codec)
    assert gpx.sniff(data[:8192])
    log = gpx.read(Path("x.gpx"), data)
    assert len(log.parts["gnss"]) == 10
    assert not log.lost


@pytest.mark.parametrize(
    ("codec", "words"), [("utf-8", "document type"), ("utf-16", "document type"), ("utf-16-le", ".")]
)
def test_entities_are_refused(codec, words):
    lol = '<!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
    with pytest.raises(WildlabError, match=words):
        gpx.read(Path("x.gpx"), (lol + document(track()).decode()).encode(codec))
