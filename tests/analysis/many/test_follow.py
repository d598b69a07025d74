"""All targets of a flight at once: found without names, beside the truth, and what is refused."""

import numpy as np
import pytest

from tests.analysis.conftest import changed
from tests.analysis.robots import boat, joined, robot_flight
from tests.refused import refused
from wildlab.analysis.tracks.many import (
    complete_scans,
    known_scans,
    score_identities,
    track_jointly,
    tracks_table,
)
from wildlab.flight.manifest import parse_settings


def test_a_boat_among_clutter_is_found_without_its_name():
    flight = robot_flight(kind="position", clutter=2, labelled=False, seed=3)
    followed = track_jointly(flight)
    lives = score_identities(followed)
    assert lives is not None
    assert lives.targets["boat"].tracked > 0.9 and lives.swaps == lives.breaks == 0
    assert lives.false_tracks_per_minute <= 1
    table = tracks_table(followed)
    longest = table[table["track"] == table["track"].mode()[0]]
    errors = []
    for name in ("", "smoothed_"):
        off = longest[[f"{name}north_m", f"{name}east_m"]].to_numpy() - boat(longest["time_s"].to_numpy())
        errors.append(np.sqrt(np.nanmean((off**2).sum(axis=1))))
    assert errors[1] < 0.8 * errors[0] < 1.2
    # What was not believed yet is known in the end, from the first scan on.
    assert longest["north_m"].isna().sum() == 2 and longest["smoothed_north_m"].notna().all()
    assert (longest["existence"].dropna() > 0.5).all() and {"p_00", "p_33", "kind_1"} <= set(longest)


def test_without_truth_there_is_nothing_to_compare():
    followed = track_jointly(robot_flight(kind="position", truth=False))
    assert score_identities(followed) is None and followed.truth == {} and followed.minutes > 1


def test_bearings_help_where_places_are_known_and_begin_nothing_alone():
    """They are exact here, and the places wrong by metres: across the line of sight tracks are nearer."""
    places = robot_flight(kind="position", seconds=60.0)
    bearings = robot_flight(kind="bearing", sensor="eye", seconds=60.0)
    both = joined(places, bearings)
    with_eye, without = track_jointly(both), track_jointly(places)
    assert list(with_eye.places) == ["radar", "eye"] and not with_eye.notes
    errors = []
    for followed in (with_eye, without):
        lives = score_identities(followed, at=["radar"])
        assert lives is not None and len(lives.gospa) == len(without.scans)
        errors.append(np.mean([one.distance for one in lives.gospa]))
        assert len(lives.tracks) == 1
    assert errors[0] < errors[1]
    several = parse_settings("[sensors.eye.many]\nseveral = true\n")
    with refused("one hull"):
        track_jointly(both, settings=several)
    with refused("bearings alone"):
        track_jointly(bearings)


def test_bearings_whose_errors_last_are_thinned():
    places = robot_flight(kind="position", seconds=60.0)
    bearings = robot_flight(kind="bearing", sensor="eye", seconds=60.0)
    both = joined(places, bearings)
    followed = track_jointly(both, settings=parse_settings("[sensors.eye]\nthinning_s = 5.0\n"))
    times = np.array([one.time for one in followed.places["eye"].scans])
    every = len(track_jointly(both).places["eye"].scans)
    assert np.diff(times).min() >= 5 - 1e-6 and len(times) < every
    assert any(f"{len(times)} are used" in note for note in followed.notes)


HULL = "[[targets.many.hulls]]\nname = 'a'\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[targets.many]\nbirth = 0.01\n", "no track"),
        (HULL + HULL, "two kinds"),
        (HULL + "length_m = 6.0\nbeam_m = 9.0\n", "beam_m"),
        ("[sensors.radar.many]\nrough_m = [1.0, 2.0]\n", "rough_m"),
        ("[sensors.radar.many]\nnear_m = 5000.0\n", "5000 m"),
        ("[sensors.radar.many]\nnear_m = 300\nfar_m = 20\n", "far_m"),
    ],
)
def test_settings_that_nothing_can_satisfy_are_refused(text, words):
    with refused(words):
        track_jointly(robot_flight(kind="position"), settings=parse_settings(text))


def test_only_what_an_image_shows_or_a_detection_names_could_be_seen():
    followed = track_jointly(robot_flight(kind="position", labelled=False))
    away = [scan._replace(sees=lambda at: np.zeros(len(at), bool)) for scan in followed.scans]
    lives = score_identities(followed._replace(scans=away))
    assert lives is not None and lives.targets["boat"].visible == 0
    named = [frozenset({"boat"}) if row < 30 else frozenset() for row in range(len(away))]
    lives = score_identities(followed._replace(scans=away, named=named))
    assert lives is not None and lives.targets["boat"].visible == 30


def test_where_a_true_place_is_not_known_nothing_is_judged():
    """The truth ends half-way: a track on a boat that is still there is not false."""
    flight = robot_flight(kind="position", seconds=100.0)
    truth = flight.table("truth")
    early = truth[truth["time_s"] < truth["time_s"].min() + 50]
    followed = track_jointly(changed(flight, truth=early))
    lives, known = score_identities(followed), known_scans(followed)
    assert lives is not None and 0.3 < known.mean() < 0.7 and len(lives.gospa) == known.sum()
    assert lives.false_tracks_per_minute == 0 and not any(one.n_false for one in lives.gospa)


def test_detections_that_are_no_sensors_are_told_and_not_left_out_in_silence():
    flight = robot_flight()
    frames, seen = flight.table("frames").assign(sensor="radar"), flight.table("detections")
    some = seen.assign(source=np.where(np.arange(len(seen)) < 5, "rader", "radar"))
    followed = track_jointly(changed(flight, frames=frames, detections=some))
    assert any("5 detections" in note and "are not used" in note for note in followed.notes)
    assert not any("are not used" in note for note in track_jointly(flight).notes)


def test_what_the_truth_may_be_off_is_beside_the_tracks_own():
    """Fixes of a receiver that is wrong by metres: without its own error tracks would be called wrong.

    Where nobody states it, it is estimated from how rough they are.
    """
    flight = robot_flight(kind="position", seconds=100.0)
    truth = flight.table("truth").copy()
    rng = np.random.default_rng(0)
    truth[["north_m", "east_m"]] += rng.normal(0, 5.0, (len(truth), 2))
    found = []
    for sd in (0.0, 5.0, np.nan):
        followed = track_jointly(changed(flight, truth=truth.assign(sd_horizontal_m=sd)))
        lives = score_identities(followed)
        assert lives is not None
        found.append(max(one.anees / 2 for one in lives.tracks.values()))
        assert max(one.anees_alone / 2 for one in lives.tracks.values()) > 5
    assert found[0] > 5 and found[1] < 1.5 and found[2] < 1.5
    assert followed.truth_estimated == ["boat"] and followed.truth_sd["boat"] == pytest.approx(5.0, rel=0.1)


def test_how_near_a_track_counts_and_whether_others_are_about_is_stated():
    flight = robot_flight(kind="position", clutter=2, labelled=False, seed=3, heading_off_deg=8.0)
    near, far = (
        score_identities(track_jointly(flight, settings=parse_settings(f"[targets]\nreach_m = {reach}\n")))
        for reach in (5.0, 40.0)
    )
    assert near is not None and far is not None
    assert near.targets["boat"].tracked < 0.5 < far.targets["boat"].tracked
    alone = [one for one in near.tracks.values() if one.false]
    text = "[targets]\nreach_m = 5.0\n[targets.many]\nothers = true\n"
    followed = track_jointly(flight, settings=parse_settings(text))
    beside = score_identities(followed)
    assert beside is not None and alone and not any(one.false for one in beside.tracks.values())
    assert not complete_scans(followed).any()
    assert max(one.n_false for one in beside.gospa) == 0 < max(one.n_false for one in near.gospa)
