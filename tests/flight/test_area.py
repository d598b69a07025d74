"""Areas out of GeoJSON and KML: what is read, and each damage refused by its own sentence."""

import json
import math

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.vector import crossing, parse_areas, read_areas
from wildlab.geometry.frames import ned_to_geodetic

LAT, LON = 58.66, 16.46
SQUARE = [[0, 0], [0, 200], [100, 200], [100, 0], [0, 0]]
LARGER = [[-9, -9], [-9, 300], [300, 300], [300, -9], [-9, -9]]


def moved(north):
    return [[a + north, b] for a, b in SQUARE]


def degrees(points, at=(LAT, LON)):
    """Longitude and latitude of metres north and east."""
    origin = (math.radians(at[0]), math.radians(at[1]), 0.0)
    p = np.column_stack([np.array(points, float), np.zeros(len(points))])
    lat, lon, _ = ned_to_geodetic(p, origin).T
    return np.degrees(np.column_stack([lon, lat])).tolist()


def polygon(*rings, at=(LAT, LON)):
    return {"type": "Polygon", "coordinates": [degrees(ring, at) for ring in rings]}


def feature(geometry, **about):
    return {"type": "Feature", "properties": about, "geometry": geometry}


def collection(*features):
    return {"type": "FeatureCollection", "features": list(features)}


def parse(content, tmp_path):
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    return parse_areas(data, tmp_path / "area.geojson")


def test_an_area_comes_out_in_metres_about_its_middle(tmp_path):
    path = tmp_path / "area.geojson"
    path.write_text(json.dumps(collection(feature(polygon(SQUARE), name="Wolf"))), encoding="utf-8-sig")
    areas, origin = read_areas(path)
    assert np.allclose(areas[0].outline, np.array(SQUARE[:4]) - [50, 100], atol=0.01)
    assert areas[0].name == "Wolf" and math.isnan(areas[0].animals)
    assert areas[0].size == pytest.approx(20_000, rel=1e-4)
    middle = ned_to_geodetic([50.0, 100.0, 0.0], (math.radians(LAT), math.radians(LON), 0.0))
    assert np.allclose(origin[:2], middle[:2], atol=1e-8)


def test_holes_parts_and_names(tmp_path):
    hole = [[20, 20], [20, 40], [40, 40], [40, 20], [20, 20]]
    far = moved(500)
    many = {
        "type": "MultiPolygon",
        "coordinates": [polygon(SQUARE)["coordinates"], polygon(far)["coordinates"]],
    }
    content = collection(
        feature(polygon(SQUARE, hole), name="Bear\x1b[2J\n ", animals=7),
        feature(many, name="Moose"),
        feature({"type": "GeometryCollection", "geometries": [polygon(far)]}),
    )
    areas, _ = parse(content, tmp_path)
    assert [one.name for one in areas] == ["Bear [2J", "Moose", "Moose (2)", "area 4"]
    assert areas[0].animals == 7 and len(areas[0].holes) == 1
    assert areas[0].size == pytest.approx(20_000 - 400, rel=1e-4)
    assert areas[2].outline[:, 0].min() == pytest.approx(areas[1].outline[:, 0].min() + 500, abs=0.01)


def test_the_antimeridian_is_crossed_by_parts(tmp_path):
    parts = collection(*(feature(polygon(SQUARE, at=(-17.0, lon))) for lon in (179.995, -179.999)))
    areas, origin = parse(parts, tmp_path)
    apart = areas[1].outline[:, 1].min() - areas[0].outline[:, 1].min()
    assert apart == pytest.approx(0.006 * 111_320 * math.cos(math.radians(17)), rel=0.005)
    assert abs(abs(math.degrees(origin[1])) - 180) < 0.01


def ring(points):
    return polygon([*points, points[0]])


def raw(*points):
    return {"type": "Polygon", "coordinates": [[*points, points[0]]]}


def swapped(at=(LAT, 100.0)):
    return {"type": "Polygon", "coordinates": [[[b, a] for a, b in degrees(SQUARE, at)]]}


BAD = {
    "not JSON": (b"{", "is not GeoJSON"),
    "too deep": (b"[" * 200_000, "is not GeoJSON"),
    "nothing in it": (collection(), "has no polygon"),
    "a line": ({"type": "LineString", "coordinates": []}, "has no polygon"),
    "another CRS": (
        {**polygon(SQUARE), "crs": {"type": "name", "properties": {"name": "EPSG:3006"}}},
        "EPSG:3006",
    ),
    "swapped": (swapped(), "swapped"),
    "a huge integer": (
        raw([10**400, 1], [2, 2], [3, 3]), "does not fit",
    ),
    "latitude": (raw([150, 95], [151, 95], [150, 96]), "latitude of 96"),
    "self-crossing": (ring([[0, 0], [100, 100], [100, 0], [0, 100]]), "crosses itself"),
    "next to nothing": (ring([[0, 0], [0, 0.6], [0.5, 0]]), "0.15 square"),
    "no ring": ({"type": "Polygon", "coordinates": []}, "at least 1 item"),
    "animals": (feature(polygon(SQUARE), animals=-3), "'-3' animals"),
    "shared animals": (
        feature(
            {"type": "MultiPolygon", "coordinates": [polygon(SQUARE)["coordinates"]] * 2}, name="x", animals=3
        ),
        "3 animals in 2",
    ),
    "all round the Earth": (
        raw([-179.9, 1], [179.9, 1], [179.9, 1.1]),
        "antimeridian",
    ),
    "far apart": (
        collection(feature(polygon(SQUARE)), feature(polygon(SQUARE, at=(-LAT, LON)))), "km from the middle",
    ),
    "a hole too large": (polygon(SQUARE, LARGER), "holes"),
    "a zip": (b"PK\x03\x04" + b"\0" * 100, "is a zip"),
}  # fmt: skip


# -- KML


def kml(body, head=""):
    return (
        f'<?xml version="1.0"?>{head}<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{body}</Document></kml>'
    ).encode()


def placemark(*rings, name="Lynx"):
    borders = []
    for k, points in enumerate(rings):
        tag = "innerBoundaryIs" if k else "outerBoundaryIs"
        words = "\n ".join(f"{lon},{lat},0" for lon, lat in degrees(points))
        borders.append(f"<{tag}><LinearRing><coordinates>{words}</coordinates></LinearRing></{tag}>")
    return f"<Placemark><Polygon>{''.join(borders)}</Polygon><name>{name}</name></Placemark>"


def test_kml_gives_the_same_as_geojson(tmp_path):
    hole = [[20, 20], [20, 40], [40, 40], [40, 20], [20, 20]]
    two = moved(500)
    found = parse(kml(placemark(SQUARE, hole) + placemark(two, name="Wolf &amp; co")), tmp_path)
    same = parse(
        collection(feature(polygon(SQUARE, hole), name="Lynx"), feature(polygon(two), name="Wolf & co")),
        tmp_path,
    )
    assert found.origin == pytest.approx(same.origin, abs=1e-12)
    for one, other in zip(found.areas, same.areas, strict=True):
        assert one.name == other.name and len(one.holes) == len(other.holes)
        assert np.allclose(one.outline, other.outline, atol=1e-6)


@pytest.mark.parametrize("ending", [",", "", ",,"])
def test_heights_may_be_missing_and_rings_in_any_order(ending, tmp_path):
    """Near 45 N 45 E nothing but the count of numbers tells longitudes from latitudes."""
    hole = [[20, 20], [20, 40], [40, 40], [40, 20], [20, 20]]
    whole = placemark(SQUARE, hole)
    bare = whole.replace(",0", ending)
    outer, inner = bare.index("<outerBoundaryIs>"), bare.index("<innerBoundaryIs>")
    end = bare.index("</Polygon>")
    turned = bare[:outer] + bare[inner:end] + bare[outer:inner] + bare[end:]
    for text in (bare, turned):
        (one,), (same,) = (parse(kml(each), tmp_path).areas for each in (text, whole))
        assert np.allclose(one.outline, same.outline) and len(one.holes) == 1
        assert one.size == pytest.approx(same.size)


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'
BAD_KML = {
    "KML cut off": (kml(placemark(SQUARE))[:-30], "is not KML"),
    "entities": (kml("<Placemark><name>&b;</name></Placemark>", BOMB), "document type"),
    "a file from elsewhere": (
        kml("", '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'),
        "document type",
    ),
    "other XML": (b"<gpx></gpx>", "no KML"),
    "no polygon": (kml("<Placemark><Point><coordinates>1,2</coordinates></Point></Placemark>"), "has no"),
    "no coordinate": (kml(placemark(SQUARE).replace(",", ";")), "is no coordinate"),
    "KML too deep": (kml("<a>" * 200 + "</a>" * 200), "too deep"),
    "no coordinates": (kml("<Placemark><Polygon></Polygon></Placemark>"), "no coordinates"),
}  # fmt: skip


@pytest.mark.parametrize("case", [*BAD, *BAD_KML])
def test_each_damage_is_a_sentence(case, tmp_path):
    content, said = (BAD | BAD_KML)[case]
    with pytest.raises(WildlabError, match=said) as caught:
        parse(content, tmp_path)
    message = str(caught.value)
    assert "area.geojson" in message and "root:" not in message and len(message) < 500


# -- rings


def test_a_ring_that_crosses_itself_is_found_wherever_it_begins():
    bow = np.array([[0.0, 0], [100, 100], [100, 0], [0, 100]])
    comb = np.array([[0.0, 0], [0, 9], [5, 9], [5, 6], [2, 6], [2, 3], [5, 3], [5, 0]])
    for k in range(8):
        assert crossing(np.roll(bow, k, axis=0)) is not None
        assert crossing(np.roll(comb, k, axis=0)) is None
        assert crossing(np.roll(comb, k, axis=0)[::-1]) is None
    assert (
        crossing(np.array([[0.0, 0], [0, 10], [5, 5], [10, 10], [10, 0], [5, 5]])) is not None
    )  # touches itself
