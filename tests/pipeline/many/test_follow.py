"""All targets of a flight at once: found without names, beside the truth, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.pipeline.robots import boat, robot_flight
from wildlab.errors import WildlabError
from wildlab.flight.following import parse_settings, settings_over
from wildlab.pipeline.many.beliefs import LEAST_FALSE
from wildlab.pipeline.many.follow import complete_looks, follow_all, judged, known_looks, tracks_table


def test_a_boat_among_clutter_is_found_without_its_name() -> None:
    flight = robot_flight(kind="position", clutter=2, labelled=False, seed=3)
    followed = follow_all(flight)
    lives = judged(followed)
    assert lives is not None
    assert lives.targets["boat"].tracked > 0.9 and lives.swaps == lives.breaks == 0
    assert lives.false_tracks_per_minute <= 1
    table = tracks_table(followed)
    longest = table[table["track"] == table["track"].mode()[0]]
    off = longest[["north_m", "east_m"]].to_numpy() - boat(longest["time_s"].to_numpy())
    assert np.sqrt((off**2).sum(axis=1).mean()) < 1.5
    assert (longest["existence"] > 0.5).all() and {"p_00", "p_33", "kind_1"} <= set(longest)


def test_what_was_told_says_where_it_is_from() -> None:
    text = "[targets.many]\nbirth = 0.2\n[sensors.radar.many]\ndetection = 0.7\n"
    said = follow_all(robot_flight(kind="position"), settings=parse_settings(text)).said
    by_words = {one.what: one for one in said}
    assert by_words["probability that a detection of nothing known is a new target"].source == "stated"
    assert by_words["probability that what is in view is detected"].value == "0.7"
    assert by_words["distance above which it sees nothing"].source == "estimated here"
    assert by_words["how long a target is about"].source == "assumed"


def test_without_truth_there_is_nothing_to_compare() -> None:
    followed = follow_all(robot_flight(kind="position", truth=False))
    assert judged(followed) is None and followed.truth == {} and followed.minutes > 1


def test_a_target_out_of_reach_costs_nothing() -> None:
    followed = follow_all(robot_flight(kind="position", labelled=False))
    lives = judged(followed, {"boat": 1.0})
    assert lives is not None and lives.targets["boat"].visible == 0
    assert max(one.distance for one in lives.gospa) == 0


def test_bearings_help_where_places_are_known_and_begin_nothing_alone() -> None:
    """They are exact here, and the places wrong by metres: across the line of sight tracks are nearer."""
    places, bearings = robot_flight(kind="position"), robot_flight(kind="bearing", sensor="eye")
    both = pd.concat([places.table("detections"), bearings.table("detections")], ignore_index=True)
    frames = pd.concat([places.table("frames"), bearings.table("frames")], ignore_index=True)
    joined = replace(places, tables={**places.tables, "detections": both, "frames": frames})
    with_eye, without = follow_all(joined), follow_all(places)
    assert list(with_eye.places) == ["radar", "eye"] and not with_eye.notes
    errors = []
    for followed in (with_eye, without):
        lives = judged(followed, at=["radar"])
        assert lives is not None and len(lives.gospa) == len(without.scans)
        errors.append(np.mean([one.distance for one in lives.gospa]))
        assert len(lives.tracks) == 1
    assert errors[0] < errors[1]
    told = {one.what: one.value for one in with_eye.said if one.subject == "eye"}
    # One detection in every look, none of them false: the least that is taken, over a full turn.
    assert float(told["false detections in a look within a radian"]) == pytest.approx(
        LEAST_FALSE / (2 * np.pi), rel=0.01
    )
    several = parse_settings("[sensors.eye.many]\nseveral = true\n")
    with pytest.raises(WildlabError, match="several of one hull cannot be told as one"):
        follow_all(joined, settings=several)
    with pytest.raises(WildlabError, match="bearings alone begin no track"):
        follow_all(bearings)


def test_bearings_whose_errors_last_are_thinned() -> None:
    places, bearings = robot_flight(kind="position"), robot_flight(kind="bearing", sensor="eye")
    both = pd.concat([places.table("detections"), bearings.table("detections")], ignore_index=True)
    frames = pd.concat([places.table("frames"), bearings.table("frames")], ignore_index=True)
    joined = replace(places, tables={**places.tables, "detections": both, "frames": frames})
    followed = follow_all(joined, settings=parse_settings("[sensors.eye]\nthinning_s = 5.0\n"))
    times = np.array([one.time for one in followed.places["eye"].scans])
    every = len(follow_all(joined).places["eye"].scans)
    assert np.diff(times).min() >= 5 - 1e-6 and len(times) < every
    assert (
        f"Of {every} looks of eye {len(times)} are used, 5 s apart: errors of bearings last."
        in followed.notes
    )


def test_a_birth_that_nothing_survives_is_refused() -> None:
    settings = parse_settings("[targets.many]\nbirth = 0.01\n")
    with pytest.raises(WildlabError, match="no track would ever last") as caught:
        follow_all(robot_flight(kind="position"), settings=settings)
    assert caught.value.field == "targets.many.birth"


def test_two_hulls_of_one_name_are_refused() -> None:
    settings = parse_settings("[[targets.many.hulls]]\nname = 'a'\n[[targets.many.hulls]]\nname = 'a'\n")
    with pytest.raises(WildlabError, match="two kinds of hulls are called 'a'"):
        follow_all(robot_flight(kind="position"), settings=settings)
    with pytest.raises(WildlabError, match=r"beam_m = 9 is above length_m = 6"):
        parse_settings("[[targets.many.hulls]]\nname = 'a'\nlength_m = 6.0\nbeam_m = 9.0\n")


def test_numbers_for_hulls_that_there_are_not() -> None:
    words = "rough_m of the sensor 'radar' has 2 values, and kinds of hulls there are 1"
    settings = parse_settings("[sensors.radar.many]\nrough_m = [1.0, 2.0]\n")
    with pytest.raises(WildlabError, match=words):
        follow_all(robot_flight(kind="position"), settings=settings)


def test_a_sensor_that_reaches_less_far_than_it_is_blind() -> None:
    settings = parse_settings("[sensors.radar.many]\nnear_m = 5000.0\n")
    with pytest.raises(WildlabError, match="sees nothing nearer than 5000 m or farther than"):
        follow_all(robot_flight(kind="position"), settings=settings)


def test_only_what_an_image_shows_or_a_detection_names_could_be_seen() -> None:
    followed = follow_all(robot_flight(kind="position", labelled=False))
    away = [scan._replace(sees=lambda at: np.zeros(len(at), bool)) for scan in followed.scans]
    lives = judged(followed._replace(scans=away))
    assert lives is not None and lives.targets["boat"].visible == 0
    named = [frozenset({"boat"}) if row < 30 else frozenset() for row in range(len(away))]
    lives = judged(followed._replace(scans=away, named=named))
    assert lives is not None and lives.targets["boat"].visible == 30


def test_no_track_leaves_an_empty_table() -> None:
    text = "[targets.many]\nhits = 1000\n"
    followed = follow_all(robot_flight(kind="position"), settings=parse_settings(text))
    assert list(tracks_table(followed)) == ["time_s", "sensor", "track", "north_m", "east_m"]


def test_where_a_true_place_is_not_known_nothing_is_judged() -> None:
    """The truth ends half-way: a track on a boat that is still there is not false."""
    flight = robot_flight(kind="position", seconds=100.0)
    truth = flight.table("truth")
    early = truth[truth["time_s"] < truth["time_s"].min() + 50]
    followed = follow_all(replace(flight, tables={**flight.tables, "truth": early}))
    lives, known = judged(followed), known_looks(followed)
    assert lives is not None and 0.3 < known.mean() < 0.7 and len(lives.gospa) == known.sum()
    assert lives.false_tracks_per_minute == 0 and not any(one.n_false for one in lives.gospa)


def test_where_some_true_places_are_known_tracks_on_others_are_not_judged() -> None:
    """Another boat's truth is known for half of the time: a track may be on it for the rest."""
    flight = robot_flight(kind="position", seconds=100.0)
    truth = flight.table("truth")
    other = truth[truth["time_s"] < truth["time_s"].min() + 50].assign(target_id="other", north_m=900.0)
    both = pd.concat([truth, other], ignore_index=True)
    followed = follow_all(replace(flight, tables={**flight.tables, "truth": both}))
    lives, whole = judged(followed), complete_looks(followed)
    assert lives is not None and 0.3 < whole.mean() < 0.7
    assert lives.incomplete == int((~whole).sum()) and len(lives.gospa) == len(whole)


def test_detections_that_are_no_sensors_are_told_and_not_left_out_in_silence() -> None:
    flight = robot_flight()
    frames, seen = flight.table("frames").assign(sensor="radar"), flight.table("detections")
    some = seen.assign(source=np.where(np.arange(len(seen)) < 5, "rader", "radar"))
    followed = follow_all(replace(flight, tables={**flight.tables, "frames": frames, "detections": some}))
    said = "5 detections of the source 'rader' are in looks of the sensor 'radar' and are not used"
    assert any(note.startswith(said) for note in followed.notes)
    assert not any("are not used" in note for note in follow_all(flight).notes)
    bearings = robot_flight(kind="bearing", sensor="eye")
    both = pd.concat([seen.assign(source="rader"), bearings.table("detections")], ignore_index=True)
    looks = pd.concat([frames, bearings.table("frames").assign(sensor="eye")], ignore_index=True)
    wrong = replace(bearings, tables={**bearings.tables, "detections": both, "frames": looks})
    with pytest.raises(WildlabError, match="of the source 'rader' are in looks") as caught:
        follow_all(wrong)
    assert caught.value.fix == "give detections the source of their sensor's name"


def test_what_settings_say_in_vain_is_said() -> None:
    text = "[sensors.rader.many]\ndetection = 0.7\n[sensors.radar.considered.clock]\nsd_s = 2.0\n"
    text += "[sensors.radar.considered.heading]\nsd_deg = 2.0\n"
    followed = follow_all(robot_flight(), settings=parse_settings(text))
    notes, said = followed.notes, [one.what for one in followed.said]
    said_of = "The settings speak of a sensor 'rader', which this flight does not have; did you mean 'radar'?"
    assert any(note.startswith(said_of) for note in notes)
    assert "An error of the clock of radar is not considered where many targets are followed." in notes
    assert "considered error: heading" in said and "considered error: clock" not in said
    assert followed.lasting_s == (np.inf,)
    bearings = robot_flight(kind="bearing", sensor="eye")
    both = pd.concat([robot_flight().table("detections"), bearings.table("detections")], ignore_index=True)
    frames = pd.concat([robot_flight().table("frames"), bearings.table("frames")], ignore_index=True)
    joined = replace(bearings, tables={**bearings.tables, "detections": both, "frames": frames})
    told = parse_settings("[sensors.eye.considered.heading]\nsd_deg = 2.0\n")
    notes = follow_all(joined, settings=told).notes
    assert "Errors of eye that last are not considered where many targets are followed." in notes


def test_a_sensor_that_sees_nothing_is_refused() -> None:
    with pytest.raises(WildlabError, match="near_m = 300 is not below far_m = 20"):
        parse_settings("[sensors.radar.many]\nnear_m = 300\nfar_m = 20\n")


def test_settings_for_many_are_merged_key_by_key() -> None:
    own = parse_settings('[targets.many]\nhits = 4\n[[targets.many.hulls]]\nname = "ship"\n')
    many = settings_over(parse_settings("[targets.many]\ngate = 3.0\n"), own).targets.many
    assert many is not None and (many.gate, many.hits, many.hulls[0].name) == (3.0, 4, "ship")


def test_calm_motions_are_told_where_there_are_any() -> None:
    one = follow_all(robot_flight(kind="position", seconds=20.0))
    calm = parse_settings("[targets.many]\ncalm = 0.2\nstay_s = 12.0\n")
    two = follow_all(robot_flight(kind="position", seconds=20.0), settings=calm)
    words = [{said.what: (said.value, said.source) for said in each.said} for each in (one, two)]
    share, lasts = (
        "calm motion: share of the usual acceleration, 1: there is none",
        "how long either motion lasts",
    )
    assert words[0][share] == ("1", "assumed") and lasts not in words[0]
    assert words[1][share] == ("0.2", "stated") and words[1][lasts] == ("12 s", "stated")
    assert (two.targets.calm, two.targets.stay_s) == (0.2, 12.0)
    assert two.shown[-1].kinds.shape == (1, 1)


def test_what_the_truth_may_be_off_is_beside_the_tracks_own() -> None:
    """Fixes of a receiver that is wrong by metres: without its own error tracks would be called wrong.

    Where nobody states it, it is estimated from how rough they are.
    """
    flight = robot_flight(kind="position", seconds=200.0)
    truth = flight.table("truth").copy()
    rng = np.random.default_rng(0)
    truth[["north_m", "east_m"]] += rng.normal(0, 5.0, (len(truth), 2))
    found = []
    for sd in (0.0, 5.0, np.nan):
        off = replace(flight, tables={**flight.tables, "truth": truth.assign(sd_horizontal_m=sd)})
        followed = follow_all(off)
        lives = judged(followed)
        assert lives is not None
        found.append(max(one.anees / 2 for one in lives.tracks.values()))
        assert max(one.anees_alone / 2 for one in lives.tracks.values()) > 5
    assert found[0] > 5 and found[1] < 1.5 and found[2] < 1.5
    assert followed.truth_estimated == ["boat"] and followed.truth_sd["boat"] == pytest.approx(5.0, rel=0.1)


def test_how_near_a_track_counts_and_whether_others_are_about_is_stated() -> None:
    flight = robot_flight(kind="position", clutter=2, labelled=False, seed=3, heading_off_deg=8.0)
    near, far = (
        judged(follow_all(flight, settings=parse_settings(f"[targets]\nreach_m = {reach}\n")))
        for reach in (5.0, 40.0)
    )
    assert near is not None and far is not None
    assert near.targets["boat"].tracked < 0.5 < far.targets["boat"].tracked
    alone = [one for one in near.tracks.values() if one.false]
    text = "[targets]\nreach_m = 5.0\n[targets.many]\nothers = true\n"
    followed = follow_all(flight, settings=parse_settings(text))
    beside = judged(followed)
    assert beside is not None and alone and not any(one.false for one in beside.tracks.values())
    assert not complete_looks(followed).any() and beside.incomplete == len(beside.gospa)
    assert max(one.n_false for one in beside.gospa) == 0 < max(one.n_false for one in near.gospa)
