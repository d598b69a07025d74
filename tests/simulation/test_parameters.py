"""A twin's file: every number accounted for, every fault named, and values that are varied."""

from __future__ import annotations

import re
import tomllib

import pytest

from wildlab.errors import WildlabError
from wildlab.simulation.manifest import twin_manifest
from wildlab.simulation.parameters import (
    PARTS,
    TOLD,
    TWINS,
    apply,
    each_parameter,
    fitted_to,
    groups_of,
    load_twin,
    parameters_table,
    part_names,
    twin_names,
    varied,
)


def complete(name: str) -> str:
    """The text of a twin with its parts written out in it."""
    lines = (TWINS / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    parts = next(tomllib.loads(line)["parts"] for line in lines if line.startswith("parts ="))
    text = "\n".join(line for line in lines if not line.startswith("parts ="))
    for part in parts[::-1]:
        for block in re.split(r"(?m)^(?=\[)", (PARTS / f"{part}.toml").read_text(encoding="utf-8"))[1:]:
            if block.splitlines()[0] not in text:  # what is there goes before what comes
                text += f"\n{block}"
    return text


def load_text(folder, text):
    """The twin of a file with this text."""
    path = folder / "twin.toml"
    path.write_text(text, encoding="utf-8")
    return load_twin(path)


@pytest.fixture
def altered(tmp_path):
    """Load the shipped twin with some text of its file replaced."""

    def load(old: str, new: str):
        text = complete("static-antenna")
        assert text.count(old) == 1, f"{old!r} is there {text.count(old)} times"
        return load_text(tmp_path, text.replace(old, new))

    return load


def test_every_parameter_of_every_twin_is_accounted_for():
    assert "static-antenna" in twin_names()
    for name in twin_names():
        for group, key, parameter in each_parameter(load_twin(name)):
            where = f"{name}: {group}.{key}"
            if parameter.status == "published":
                assert re.search(r"\b[HF] (\d|table|fig|\()", parameter.source), where
            else:
                assert len(parameter.reason) > 8, where
            assert bool(parameter.fitted_to) == (parameter.status == "fitted"), where


def exchanged_imu(tmp_path, part: str):
    text = (TWINS / "static-antenna.toml").read_text(encoding="utf-8")
    assert text.count('"imu-adis16490"') == 1
    return load_text(tmp_path, text.replace("imu-adis16490", part))


@pytest.mark.parametrize(
    ("part", "figures"),
    [
        # H tables A.5 and A.6, typed again; g is 9.80665 m/s^2.
        ("imu-adis16490", (0.008, 0.09, 3.6e-6 * 9.80665, 1.8, 3.5e-3 * 9.80665, 180.0, 0.25, 0.05)),
        ("imu-stim300", (0.07, 0.15, 50e-6 * 9.80665, 0.3, 0.75e-3 * 9.80665, 10.0, 0.0572958, 0.0114592)),
    ],
)
def test_the_manifest_states_the_data_sheet_of_the_sensor(tmp_path, part, figures):
    manifest = twin_manifest(exchanged_imu(tmp_path, part), 1)
    stated = manifest.imu
    assert (
        stated.velocity_random_walk_m_s_sqrt_h,
        stated.angle_random_walk_deg_sqrt_h,
        stated.accelerometer_bias_m_s2,
        stated.gyro_bias_deg_h,
        stated.accelerometer_turn_on_m_s2,
        stated.gyro_turn_on_deg_h,
        stated.misalignment_deg,
        stated.axis_misalignment_deg,
    ) == pytest.approx(figures, rel=1e-5)
    assert stated.accelerometer_bias_time_s == stated.gyro_bias_time_s == 300.0
    assert manifest.gnss.lever_arm_m == (0.5, 0.0, -0.1)
    assert manifest.gnss.latency_s == 0.0


def test_a_part_that_does_not_exist_is_refused(tmp_path):
    assert "imu-stim300" in part_names()
    for wrong in ("imu-stim30", "../static-antenna"):
        with pytest.raises(WildlabError, match="no part"):
            exchanged_imu(tmp_path, wrong)


def test_units_are_converted_once():
    twin = load_twin("static-antenna")
    assert twin.autopilot.imu_pitch.si == pytest.approx(-0.0994838)
    assert twin.onboard_clock.drift.si == pytest.approx(5e-5)
    assert twin.camera.latency.si == pytest.approx(0.005)
    assert twin.imu.gyro_bias_stability.si == pytest.approx(8.7266e-6, rel=1e-4)  # rad/s
    assert twin.imu.gyro_random_walk.si == pytest.approx(2.61799e-5, rel=1e-4)  # rad/sqrt(s)
    assert twin.imu.accelerometer_random_walk.si == pytest.approx(1.3333e-4, rel=1e-4)  # m/s/sqrt(s)
    assert twin.imu.accelerometer_bias_stability.si == pytest.approx(3.5304e-5, rel=1e-4)
    assert twin.imu.accelerometer_turn_on_bias.si == pytest.approx(0.034323, rel=1e-4)


def test_the_table_names_value_unit_and_reason():
    table = parameters_table("static-antenna").set_index("parameter")
    assert table.loc["camera: fx"].tolist() == ["1159.2", "px", "published", "H (2.3)"]
    assert table.index.is_unique
    assert len(table) == len(list(each_parameter(load_twin("static-antenna"))))


RATE = '[camera.frame_rate]\nvalue = 7.5\nunit = "Hz"'
RADIUS = '[loiter.radius]\nvalue = 160.0\nunit = "m"\nstatus = "chosen"'
FITTED = '[loiter.radius]\nvalue = 160.0\nunit = "m"\nstatus = "fitted"\nfitted_to = ["H table 5.4"]'
REASON = '[target.identifier]\nvalue = "antenna"\nunit = ""\nstatus = "chosen"\nreason = "only a name"'


@pytest.mark.parametrize(
    ("old", "new", "field", "found"),
    [
        (RATE, RATE.replace("Hz", "kHz"), "camera.frame_rate", "'kHz'"),
        (RATE, RATE.replace("7.5", "1e9"), "camera.frame_rate", "out of range"),
        (RATE, RATE.replace("7.5", "nan"), "camera.frame_rate.value", "nan"),
        (RADIUS, RADIUS.replace("chosen", "published"), "loiter.radius", "source"),
        (RADIUS, FITTED.replace('"fitted"', '"chosen"'), "loiter.radius", "fitted_to"),
        (REASON, "", "target.identifier", "missing"),
        ("value = 7990\n", "value = 9990\n", None, "after the flight's end"),
        ('name = "static-antenna"', 'name = "../up"', "name", "'../up'"),
        ("[flight.wind_speed]\nvalue = 4.5", "[flight.wind_speed]\nvalue = 18.0", "flight", "wind_speed"),
    ],
)
def test_bad_parameters_are_named(altered, old, new, field, found):
    with pytest.raises(WildlabError) as caught:
        altered(old, new)
    assert caught.value.field == field
    assert caught.value.file is not None
    assert caught.value.file.endswith("twin.toml")
    assert re.search(found, str(caught.value)), str(caught.value)


def test_a_fitted_value_names_its_tables(altered):
    twin = altered(RADIUS, FITTED)
    assert twin.loiter.radius.fitted_to == ("H table 5.4",)
    assert parameters_table(twin).set_index("parameter").loc["loiter: radius", "status"] == "fitted"
    assert "H table 5.4" in fitted_to(twin)


LOITER = """
[loiter.radius]
value = 160.0
unit = "m"
status = "chosen"
reason = "for this test"

[loiter.turn]
value = "clockwise"
unit = ""
status = "chosen"
reason = "for this test"

[loiter.course_at_target]
value = 0.0
unit = "deg"
status = "chosen"
reason = "for this test"
"""


def test_an_unknown_twin_is_refused():
    with pytest.raises(WildlabError, match="'static-antenna'"):
        load_twin("static-antena")
    with pytest.raises(WildlabError, match="no such file"):
        load_twin("/nowhere.toml")


def own(key: str, value: float, unit: str) -> str:
    return f'\n[{key}]\nvalue = {value}\nunit = "{unit}"\nstatus = "chosen"\nreason = "for this test"\n'


def without(text: str, group: str) -> str:
    """The text without the parameters of a group."""
    return "".join(part for part in re.split(r"(?m)^(?=\[)", text) if not part.startswith(f"[{group}."))


CLIMB = own("climb.altitude", 9.0, "m") + own("climb.start", 1.0, "s") + own("climb.duration", 3.0, "s")
SEGMENTS = own("segments.count", 5, "1") + own("segments.images", 441, "1")


@pytest.mark.parametrize(
    ("twin", "leave_out", "add", "found"),
    [
        ("static-antenna", (), CLIMB, "route"),
        ("large-ship", ("segments",), "", "needs segments"),
        ("slow-vessel", ("subset",), SEGMENTS, "any other none"),
        ("large-ship", ("target.motion", "target.gps"), "", "needs a motion"),
        ("large-ship", ("onboard_clock",), "", "onboard_clock"),
    ],
)
def test_twins_whose_groups_do_not_go_together_are_named(tmp_path, twin, leave_out, add, found):
    text = complete(twin)
    for group in leave_out:
        assert f"[{group}." in text
        text = without(text, group)
    with pytest.raises(WildlabError, match=found):
        load_text(tmp_path, text + add)


@pytest.mark.parametrize(
    ("twin", "old", "new", "found"),
    [
        ("slow-vessel", "[target.gps.", "[target.gsp.", r"target\.gsp"),
        ("slow-vessel", "\n[route.shape]", LOITER + "\n[route.shape]", "one course"),
        ("crossing-vessels", "value = 349\n", "value = 900\n", "more than the observations"),
        ("crossing-vessels", 'value = "boat 2"', 'value = "boat 1"', "identifier"),
        ("gondola", "[cable.lowest]\nvalue = 3.0", "[cable.lowest]\nvalue = 30.0", "lowest is more"),
        ("gondola", "[enclosures.lake.", '[enclosures."the lake".', "'the lake'"),
    ],
)
def test_courses_and_targets_that_make_no_sense_are_named(tmp_path, twin, old, new, found):
    text = complete(twin)
    assert old in text
    with pytest.raises(WildlabError, match=found):
        load_text(tmp_path, text.replace(old, new))


def parameters(twin):
    return {f"{part}.{name}": parameter for part, name, parameter in each_parameter(twin)}


@pytest.mark.parametrize("name", twin_names())
def test_what_is_published_or_told_is_in_no_group(name):
    twin = load_twin(name)
    there, groups = parameters(twin), groups_of(twin)
    assert groups
    moved = [path for paths in groups.values() for path in paths]
    assert len(moved) == len(set(moved))
    for path in moved:
        assert there[path].status != "published" and path.partition(".")[0] not in TOLD
        assert there[path].number != 0


@pytest.mark.parametrize("name", twin_names())
def test_each_group_is_moved_and_nothing_else(name):
    twin = load_twin(name)
    for paths in groups_of(twin).values():
        try:
            moved = parameters(apply(twin, dict.fromkeys(paths, 1.25)))
        except WildlabError as error:
            assert "not possible" in str(error)
            continue
        for path, before in parameters(twin).items():
            if path in paths:
                assert moved[path].number == pytest.approx(1.25 * before.number)
            else:
                assert moved[path] == before


def test_within_it_every_twin_that_is_loaded_is_moved():
    before = load_twin("fast-vessel").boresight.roll_sd.number
    with varied({"boresight.roll_sd": 0.5}):
        assert load_twin("fast-vessel").boresight.roll_sd.number == before / 2
        with varied({}):
            assert load_twin("fast-vessel").boresight.roll_sd.number == before
    assert load_twin("fast-vessel").boresight.roll_sd.number == before
    with pytest.raises(ZeroDivisionError), varied({"boresight.roll_sd": 0.5}):
        raise ZeroDivisionError
    assert load_twin("fast-vessel").boresight.roll_sd.number == before


def test_what_may_not_be_moved_is_refused():
    twin = load_twin("fast-vessel")
    published = next(path for path, one in parameters(twin).items() if one.status == "published")
    with pytest.raises(WildlabError, match="published"):
        apply(twin, {published: 2.0})
    assert apply(twin, {"no.such": 2.0}) == twin
    with pytest.raises(WildlabError, match="not possible"):
        apply(twin, {"boresight.shortest_period": 1e6})
