"""Settings of tracking filters in a copy: the same to the filter, and nothing of who, or of which zone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import settings as rounds
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import ZONE_S
from wildlab.flight.files import dump_toml
from wildlab.flight.manifest import parse_settings
from wildlab.sharing.generalisation import Names, neutral_settings, whole_quarters

TOLD = """
[sensors."Letaba mast"]
clock_offset_s = -0.5
[sensors."Letaba mast".noise]
range_m = 0.5
[sensors."Letaba mast".considered.heading]
sd_deg = 1.5
[sensors."Letaba mast".many]
rough_m = [0.5, 1.5]
[sensors."Pafuri post".noise]
range_m = 1.5
[sensors.radar]
rate_hz = 2.0
[targets]
size_m = 3.0
[[targets.many.hulls]]
name = "Shingwedzi canoe"
length_m = 4.0
[[targets.many.hulls]]
name = "Skukuza ferry"
length_m = 9.0
"""


def known() -> Names:
    names = Names()
    names.learn("sensor", ["Letaba mast", "radar"])
    return names


def test_the_filter_is_told_the_same_in_neutral_names():
    told = parse_settings(TOLD)
    found, left_out = neutral_settings(told, known(), {})
    assert left_out == ("Pafuri post",)
    assert list(found.sensors) == ["sensor-1", "radar"]
    assert found.sensors["sensor-1"] == told.sensors["Letaba mast"]
    assert found.sensors["radar"] == told.sensors["radar"]
    many, before = found.targets.many, told.targets.many
    assert many is not None and before is not None
    assert [hull.name for hull in many.hulls] == ["kind A", "kind B"]
    assert [hull.length_m for hull in many.hulls] == [hull.length_m for hull in before.hulls]
    assert found.targets.model_copy(update={"many": before}) == told.targets
    text = dump_toml(found.model_dump(exclude_none=True))
    for name in ("Letaba", "Pafuri", "Shingwedzi", "canoe", "Skukuza", "ferry"):
        assert name in TOLD and name not in text
    assert parse_settings(text) == found


def test_an_offset_is_what_is_left_of_it_after_the_stamps_were_moved():
    told = parse_settings('[sensors."Letaba mast"]\nclock_offset_s = 7198.5')
    found, _ = neutral_settings(told, known(), {"Letaba mast": 7200.0})
    assert found.sensors["sensor-1"].clock_offset_s == pytest.approx(-1.5)


def test_an_offset_that_tells_a_zone_is_refused_with_what_to_do():
    told = parse_settings('[sensors."Letaba mast"]\nclock_offset_s = 7198.5')
    with pytest.raises(WildlabError, match=r"add 7198\.5 s.*State this offset in flight\.toml") as caught:
        neutral_settings(told, known(), {})
    assert caught.value.field == "sensors.Letaba mast.clock_offset_s"


@given(st.integers(-60, 60), st.floats(-449, 449))
@rounds(max_examples=50, deadline=None)
def test_of_an_offset_whole_quarters_are_cut(quarters, rest):
    assert whole_quarters(quarters * ZONE_S + rest) == pytest.approx(quarters * ZONE_S, abs=1e-6)
