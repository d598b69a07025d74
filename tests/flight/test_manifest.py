"""The manifest: what it refuses, and that it reads back what it wrote."""

import copy
import math
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.flight.conftest import MANIFEST, fault
from wildlab.errors import WildlabError
from wildlab.flight.files import dump_toml
from wildlab.flight.manifest import make_manifest, manifest_toml, read_manifest, replace_in_manifest

text = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
numbers = st.floats(allow_nan=False, allow_infinity=False)
values = st.one_of(
    text, numbers, st.integers(-(2**63), 2**63 - 1), st.booleans(), st.datetimes(timezones=st.just(UTC))
)
tables = st.recursive(
    st.dictionaries(text, st.one_of(values, st.lists(values, max_size=3)), max_size=4),
    lambda inner: st.dictionaries(
        text, st.one_of(values, inner, st.lists(inner, min_size=1, max_size=3)), max_size=4
    ),
    max_leaves=8,
)


@given(tables)
def test_toml_reads_back_what_was_written(data):
    assert tomllib.loads(dump_toml(data)) == data


def test_toml_refuses_what_it_cannot_hold():
    with pytest.raises(ValueError, match="finite"):
        dump_toml({"a": math.nan})
    with pytest.raises(TypeError, match="bytes"):
        dump_toml({"a": b"x"})


@given(
    description=text,
    note=text,
    height=st.floats(-1e4, 1e5),
    fx=st.floats(1e-6, 1e9),
    offset=st.floats(-1e9, 1e9),
    epoch=st.datetimes(timezones=st.timezones()),
    files=st.lists(st.from_regex(r"[a-z <>&\"']{1,10}\.csv", fullmatch=True), max_size=3),
)
def test_manifest_survives_the_file(description, note, height, fx, offset, epoch, files):
    data = {**copy.deepcopy(MANIFEST), "description": description, "platform": {"name": note}}
    data |= {"clocks": {"camera_offset_s": offset}, "vertical": {"note": note}}
    data |= {"sources": [{"file": name, "sha256": "0" * 64, "what": note} for name in files]}
    data["origin"]["height_m"], data["camera"]["fx_px"], data["time"]["epoch"] = height, fx, epoch
    manifest = make_manifest(data)
    assert make_manifest(tomllib.loads(manifest_toml(manifest))) == manifest


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("camera.fx_px", 0.0, "camera.fx_px: focal length is 0 px"),
        ("camera.fx_px", math.nan, "camera.fx_px: finite"),
        ("camera.width_px", 10**400, "camera.width_px: does not fit"),
        ("camera.fx_pix", 1.0, "camera.fx_pix: Did you mean 'fx_px'"),
        ("name", "../x", "name: '../x' cannot"),
        ("kind", "twin", "go together"),
        ("time", {"kind": "utc"}, "time: has no epoch"),
        ("time.epoch", datetime(2024, 1, 1), "time.epoch: has no zone"),
        ("origin.latitude_deg", 91, "origin.latitude_deg: equal to 90"),
        ("sources", [{"file": "../a.csv", "sha256": "0" * 64}], "sources[0].file: leaves its folder"),
        ("locations.sensitivity", "secret", "locations.sensitivity: 'open'"),
        ("uncertainty", {"tilt_deg": 0.0}, "greater than 0"),
    ],
)
def test_a_wrong_manifest_names_file_field_and_fix(manifest_data, key, value, said):
    part, _, last = key.rpartition(".")
    (manifest_data.setdefault(part, {}) if part else manifest_data)[last] = value
    with pytest.raises(WildlabError, match=fault(f"some/flight.toml, {said}")) as caught:
        make_manifest(manifest_data, Path("some/flight.toml"))
    assert caught.value.fix and caught.value.exit_code == 2
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("content", [b"name = ", b"\xff\xfe", b"[[[", b"a = " + b"[" * 5000])
def test_what_is_not_toml_is_one_sentence(tmp_path, content):
    (tmp_path / "flight.toml").write_bytes(content)
    with pytest.raises(WildlabError, match="is not valid TOML"):
        read_manifest(tmp_path / "flight.toml")


def test_places_are_withheld_unless_stated(manifest_data):
    assert make_manifest(manifest_data).locations.sensitivity == "withheld"


def test_geometry_is_in_radians(manifest_data):
    manifest = replace_in_manifest(
        make_manifest(dict(manifest_data)),
        {"mount": {"tilt_deg": 30.0, "misalignment_pan_deg": 90.0}, "camera": {"k3": 0.5, "p1": 0.25}},
    )
    mount = manifest.geometry_mount()
    assert mount.tilt == pytest.approx(math.pi / 6)
    assert mount.misalignment == pytest.approx((0.0, 0.0, math.pi / 2))
    assert manifest.geometry_camera().distortion == (0.0, 0.0, 0.25, 0.0, 0.5)
    assert manifest.origin_tuple() == pytest.approx((math.radians(63.4), math.radians(10.4), 40.0))


def test_replacing_an_unknown_key_is_an_error(manifest_data):
    with pytest.raises(WildlabError, match="camera_offset_s"):
        replace_in_manifest(make_manifest(manifest_data), {"clocks": {"camera_offset": 1.0}})
