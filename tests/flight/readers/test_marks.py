"""Surveyed points out of KML, GeoJSON and tables: the same points out of each, and sentences for the rest."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.flight.readers.tracks import Reader
from wildlab.errors import WildlabError
from wildlab.flight.readers import text
from wildlab.flight.readers.log import RawLog

marks_kml, marks_geojson, marks_csv = (Reader(f"marks-{one}") for one in ("kml", "geojson", "csv"))

HERE = Path("marks")
#: Name, latitude, longitude, height.
POINTS = [("A1", 63.44, 10.4, 39.5), ("B <b>", -12.5, -170.25, 101.0), ("=2+2", 0.5, 0.0, -3.0)]


def kml(points: list[tuple[str, float, float, float]], mode: str = "absolute", more: str = "") -> bytes:
    marks = "".join(
        f"<Placemark><name>{name.replace('<', '&lt;')}</name><Point><altitudeMode>{mode}</altitudeMode>"
        f"<coordinates> {lon},{lat},{high} </coordinates></Point></Placemark>"
        for name, lat, lon, high in points
    )
    start = '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
    return f"{start}{marks}{more}</Document></kml>".encode()


def geojson(points: list[tuple[str, float, float, float]], **more: Any) -> bytes:
    features = [
        {
            "type": "Feature",
            "properties": {"Name": name},
            "geometry": {"type": "Point", "coordinates": [lon, lat, high]},
        }
        for name, lat, lon, high in points
    ]
    return json.dumps({"type": "FeatureCollection", "features": features, **more}).encode()


def table(points: list[tuple[str, float, float, float]], header: str, sign: str = ",") -> bytes:
    rows = [sign.join([name, *map(repr, numbers)]) for name, *numbers in points]
    if sign == ";":
        rows = [row.replace(".", ",") for row in rows]
    return "\r\n".join([header, *rows, ""]).encode()


def values(log: RawLog, name: str) -> list[Any]:
    return list(log.parts["marks"].columns[name])


def test_rows_that_cannot_be_used_stay_and_say_why():
    rows = [("A", 63.0, 10.0, 1.0), ("A", 63.1, 10.0, 1.0), ("C", 0.0, 0.0, 1.0), ("D", 91.0, 0.0, 1.0)]
    data = table(rows, "name,lat,lon,height_sea") + b"E,x,10,1\nF,63,10,\nG,63\n,64,11,5\n"
    log = marks_csv.read(HERE, data)
    assert values(log, "why") == [
        "",
        "a name that stands there twice",
        "placeholder of a position",
        "position that is none on Earth",
        "no position",
        "no height",
        "",
    ]
    assert values(log, "name")[-1] == "7"
    assert log.lost[0].startswith("1 ")


def test_other_geometries_are_counted():
    line = (
        "<Placemark><name>way</name><LineString><coordinates>1,2 3,4</coordinates></LineString></Placemark>"
    )
    ring = "<LinearRing><coordinates>1,2 3,4 5,6 1,2</coordinates></LinearRing>"
    area = f"<Placemark><Polygon><outerBoundaryIs>{ring}</outerBoundaryIs></Polygon></Placemark>"
    log = marks_kml.read(HERE, kml(POINTS, more=line + area))
    assert values(log, "name") == [one[0] for one in POINTS]
    assert log.lost[0].startswith("2 ")
    other = {"type": "LineString", "coordinates": [[1, 2], [3, 4]]}
    both = {
        "type": "GeometryCollection",
        "geometries": [other, {"type": "MultiPoint", "coordinates": [[1, 2, 3]]}],
    }
    log = marks_geojson.read(HERE, json.dumps(both).encode())
    assert (values(log, "name"), values(log, "height_ellipsoid_m")) == (["1"], [3.0])
    assert log.lost[0].startswith("1 ")


@pytest.mark.parametrize(
    ("reader", "data", "problem"),
    [
        (marks_kml, b"<kml><Document/></kml>", "has no point"),
        (marks_kml, b'<!DOCTYPE kml [<!ENTITY a "b">]><kml>&a;</kml>', "document type"),
        (marks_kml, b"<kml>" + b"<a>" * 500, "too deep"),
        (marks_kml, b"<gpx/>", "no KML"),
        (marks_kml, b"<kml><Placemark>", "is not KML"),
        (marks_kml, kml(POINTS).replace(b"10.4,63.44", b"a,b"), "is no coordinate"),
        (marks_geojson, b"{", "is not GeoJSON"),
        (marks_geojson, b"[" * 100_000, "is not GeoJSON"),
        (marks_geojson, b'{"type": "FeatureCollection", "features": 5}', "valid list"),
        (marks_geojson, b'{"type": "Point", "coordinates": ["a"]}', "does not fit"),
        (marks_geojson, b"5", "does not fit"),
        (marks_geojson, geojson(POINTS, crs={"properties": {"name": "EPSG::25832"}}), "WGS84 is wanted"),
        (marks_csv, table(POINTS, "name,lat,lon,altitude"), "'altitude' does not"),
        (marks_csv, table(POINTS, "name,lat,lon,note"), "no column of heights"),
        (marks_csv, table(POINTS, "Punkt;Rechtswert;Hochwert;Höhe NHN", ";"), "no latitude"),
    ],
)
def test_what_is_refused(reader, data, problem):
    with pytest.raises(WildlabError, match=problem):
        reader.read(HERE, data)


def test_more_of_xml_than_memory_is_for_is_refused(monkeypatch):
    for name, most, problem in (
        ("MOST_ELEMENTS", 5, "too many"),
        ("MOST_XML", 99, "more than 99 bytes"),
    ):
        with monkeypatch.context() as bound, pytest.raises(WildlabError, match=problem):
            bound.setattr(text, name, most)
            marks_kml.read(HERE, kml(POINTS))


OLDER = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}


@pytest.mark.parametrize(
    ("reader", "data", "height"),
    [
        (marks_kml, kml(POINTS), "sea"),
        (marks_geojson, geojson(POINTS), "ellipsoid"),
        # The older standard's words for the same system.
        (marks_geojson, geojson(POINTS, crs=OLDER), "ellipsoid"),
        (marks_csv, table(POINTS, "name,latitude,longitude,height_ellipsoid"), "ellipsoid"),
        (marks_csv, table(POINTS, "Point ID;Lat;Lon;H [m MSL]", ";"), "sea"),
        (marks_csv, table(POINTS, "Punkt;Breite;Laenge;height_sea_m", ";"), "sea"),
        (marks_csv, table(POINTS, "Name;Breite;Länge;Höhe NHN (m)", ";"), "sea"),
        (marks_csv, table(POINTS, "Name;Breite;Länge;Höhe NHN", ";").decode().encode("latin-1"), "sea"),
        (marks_csv, table(POINTS, "Repère;Latitude;Longitude;Altitude NGF", ";"), "sea"),
        (marks_csv, table(POINTS, "Punto;Latitud;Longitud;Elevación sobre el mar", ";"), "sea"),
        (marks_csv, table(POINTS, "Navn;Breddegrad;Lengdegrad;Høyde NN2000", ";"), "sea"),
    ],
)
def test_points_out_of_every_format(reader, data, height):
    assert reader.sniff(data[:8192])
    log = reader.read(HERE, data)
    for name, at in (("name", 0), ("latitude_deg", 1), ("longitude_deg", 2), (f"height_{height}_m", 3)):
        assert values(log, name) == [one[at] for one in POINTS]
    assert values(log, "use") == [1.0] * 3
    assert [one for one in log.parts["marks"].columns if one.startswith("height_")] == [f"height_{height}_m"]
