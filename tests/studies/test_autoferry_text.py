"""The page on boats followed by sensors on opposed numbers: text, titles and alt texts turn with them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight
from wildlab.pipeline.following.sensor_tracks import COLUMNS, SensorTrack, table
from wildlab.pipeline.following.sensor_tuning import SensorTuning
from wildlab.reporting.published import load_claims
from wildlab.reporting.report import Report, open_report
from wildlab.studies.autoferry import charts, tables
from wildlab.studies.autoferry import text as words
from wildlab.studies.autoferry.comparison import check_claims, of_use, outcomes, with_hindsight

LIDAR = SensorTuning("lidar", "position", -0.9, -1.1, -0.8, 3.0, 0.9, 20.0, 1.2, 1.5, 0.0, 100, 50, 0.5, 300)
CAMERA = SensorTuning(
    "eo", "bearing", -1.0, -2.0, 0.5, np.radians(2), 0.8, 5.0, 0.0, 0.0, np.radians(1), 100, 50, 0.2, 9
)


def track(sensor: str, target: str, name: str, error: float, nees: float, seed: int = 0) -> SensorTrack:
    rng = np.random.default_rng(seed)
    n, m = 60, 1 if sensor == "eo" else 2
    estimate = np.column_stack([np.arange(n), np.zeros(n), np.ones(n), np.zeros(n)])
    errors = np.tile([error, 0.0, 0.0, 0.0], (n, 1))
    innovation = rng.normal(size=(n, m))
    nis = np.sum(innovation**2, axis=1)
    values = nees * rng.uniform(0.5, 1.5, n)
    known = np.ones(n, bool)
    return SensorTrack(
        sensor, target, name, np.arange(n) * 0.5, estimate, errors, values, innovation, nis, known, known,
        np.tile(np.eye(4), (n, 1, 1)),
    )  # fmt: skip


@pytest.fixture
def followed() -> list[SensorTrack]:
    return [
        track("lidar", "a", "kf", 4.0, 30.0, 1),
        track("lidar", "a", "coloured", 4.1, 3.0, 2),
        track("lidar", "a", "schmidt", 9.0, 2.0, 3),
        track("lidar", "b", "kf", 40.0, 2.0, 4),
        track("lidar", "b", "coloured", 41.0, 0.2, 5),
        track("eo", "a", "ekf", 90.0, 900.0, 6),
        track("eo", "a", "schmidt", 95.0, 300.0, 7),
    ]


@pytest.fixture
def tracks(followed: list[SensorTrack]) -> pd.DataFrame:
    return table(followed, 15.0).assign(case="scenario-3")


@pytest.fixture
def report() -> Report:
    return open_report(study="autoferry", kind="logged", flight="autoferry")


def recorded(report: Report) -> dict[tuple[str, str], float]:
    return {(m["name"], m["subject"]): m["value"] for m in report._metrics}


def test_every_track_has_the_numbers_of_its_kind(report: Report, tracks: pd.DataFrame) -> None:
    tables.record_tracks(report, tracks)
    found = recorded(report)
    lidar = {name for name, subject in found if subject == "lidar/a/scenario-3/kf"}
    camera = {name for name, subject in found if subject == "eo/a/scenario-3/ekf"}
    assert lidar == {*COLUMNS, "detections_used"} - {"lag1_autocorrelation"}
    assert camera == {*COLUMNS, "detections_used"} - {
        "lag1_autocorrelation_north",
        "lag1_autocorrelation_east",
    }
    assert found["rmse", "lidar/a/scenario-3/kf"] == pytest.approx(4.0)
    report.save()


def test_what_was_fitted_is_recorded_with_its_interval(report: Report) -> None:
    rows = tables.record_tunings(report, {"lidar": LIDAR, "eo": CAMERA})
    assert rows["offset"].tolist() == ["−0.90 (−1.1 to −0.8)", "−1.00 (−2.0 to 0.5)"]
    assert rows["sd"].tolist() == ["3.0 m", "2.0°"]
    assert rows["causes"].tolist() == ["position 1.2 m, clock 1.5 s", "heading 1.0°"]
    metric = next(m for m in report._metrics if m["subject"] == "lidar" and m["name"] == "clock_offset")
    assert (metric["low"], metric["value"], metric["high"], metric["n"]) == (-1.1, -0.9, -0.8, 300)
    assert recorded(report)["error_sd", "eo"] == pytest.approx(2.0)


def made(sensor: str, outcome: list[str], *, fixed: str = "schmidt", rmse: float = 3.0) -> pd.DataFrame:
    """Tracks of a sensor with these outcomes, beside white noise: rows as `sensor_tracks.table` has them."""
    bearing = sensor in ("ir", "eo")
    inside = {"gained": (9.0, 2.0), "too dear": (9.0, 2.0), "both inside": (2.0, 2.0)}
    inside |= {"neither inside": (9.0, 9.0), "spoilt": (2.0, 9.0), "lost": (9.0, 2.0)}
    rows = []
    for k, what in enumerate(outcome):
        share = 0.25 if what == "lost" else 1.0
        for name, anees in zip(("ekf" if bearing else "kf", fixed), inside[what], strict=True):
            rows.append(
                {
                    "sensor": sensor, "target": f"boat-{k}", "case": "scenario-3", "filter": name,
                    "kind": "bearing" if bearing else "position", "anees": anees, "nees_low": 1.0,
                    "nees_high": 3.0, "anis": 1.0, "nis_low": 1.5, "nis_high": 2.5, "seen": 40,
                    "share_with_target": share, "compared": 50, "detections": 40, "fraction_nees_inside": 0.5,
                    "rmse": rmse * (2.0 if what == "too dear" and name == fixed else 1.0),
                    "lag1_autocorrelation_north": 0.1, "lag1_autocorrelation_east": 0.1,
                    "lag1_autocorrelation": np.nan,
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def judged(rows: pd.DataFrame) -> pd.DataFrame:
    return outcomes(rows, words.KEYS, "schmidt")


MANY = judged(made("lidar", ["gained"] * 8 + ["spoilt"]))
HARM = judged(made("lidar", ["spoilt"] * 8 + ["gained"] + ["lost"] * 3))
FEW = judged(
    pd.concat([made("lidar", ["gained", "spoilt", "spoilt"]), made("radar", ["lost"])], ignore_index=True)
)
ALL_INSIDE = judged(made("radar", ["both inside"] * 4))


def test_the_headline_turns_with_what_is_gained_and_spoilt() -> None:
    assert "one filter throughout (Schmidt) helps more often than it harms" in words.headline(
        MANY, "schmidt", "x"
    )
    assert "harms more often than it helps" in words.headline(HARM, "schmidt", "x")
    few = words.headline(FEW, "schmidt", "2 scenarios that nothing is tuned on")
    assert few == (
        "On 2 scenarios that nothing is tuned on, one filter throughout (Schmidt) neither clearly helps nor "
        "clearly harms: compared with white noise, 1 of 4 tracks by lidar and radar turned honest about "
        "their error, 2 turned dishonest, and 1 got lost."
    )
    lead = judged(made("lidar", ["gained", "gained", "spoilt"]))
    assert "neither clearly helps nor clearly harms" in words.headline(lead, "schmidt", "x")
    none = words.headline(FEW.iloc[:0], "schmidt", "x")
    assert "no sensor alone keeps more than half of its tracks" in none
    assert (
        words.judged_on(["scenario-2", "scenario-3"], "scenario-2") == "1 scenario that nothing is tuned on"
    )
    assert words.judged_on(["scenario-2"], "scenario-2").endswith("nothing is held out")


def test_the_tiles_turn() -> None:
    many, harm = (dict(words.tiles(one)) for one in (MANY, HARM))
    assert many["3 m"] == "median error of the 9 of 9 tracks by lidar that stay" and "8 of 9" in many
    assert harm["3 m"] == "median error of the 9 of 12 tracks by lidar that stay"
    assert harm["1 of 12"].endswith("honest about their error; 95 % interval 1 to 35 %")
    assert harm["3 of 12"].startswith("tracks are lost")
    lost = judged(made("radar", ["lost"] * 2))
    assert words.tiles(lost)[0][0] == "—" and words.error_words(lost) == ""
    assert words.tiles(FEW.iloc[:0])[0][0] == "0"


def test_errors_are_of_the_tracks_that_stay_with_their_count() -> None:
    both = judged(
        pd.concat([made("lidar", ["gained", "lost"], rmse=3.0), made("radar", ["spoilt"], rmse=8.0)])
    )
    assert words.error_words(both) == (
        "A track that stays with its boat is typically off by 3 metres with the lidar (1 of 2 tracks stay) "
        "and "
        "8 metres with the radar (1 of 1 tracks stay)."
    )


def test_a_sensor_is_called_useless_where_it_is() -> None:
    good, bad = made("eo", ["gained"] * 3, rmse=4.0), made("ir", ["lost"] * 4, rmse=90.0)
    assert (
        words.use_words(of_use(good))
        == "Each sensor alone keeps more than half of its tracks with their boats."
    )
    said = words.use_words(of_use(pd.concat([good, bad])))
    assert said == (
        "The thermal camera alone is of no use for locating boats: with its best filter, the thermal camera "
        "keeps 0 of 4 tracks with their boats (off by 90 metres in the median)."
    )
    turned = pd.concat(
        [made("eo", ["lost"] * 3, rmse=70.0), made("ir", ["lost"] * 3 + ["gained"], rmse=80.0)]
    )
    both = words.use_words(of_use(turned))
    assert both.startswith("The colour camera and thermal camera are each alone of no use")
    assert "0 of 3" in both and "1 of 4" in both and "70 metres" in both
    assert len(words.limits(of_use(good), 0.04)) + 1 == len(words.limits(of_use(bad), 0.04))
    assert "thermal camera" in words.limits(of_use(bad), 0.04)[-1]


def test_lost_tracks_are_counted_apart_and_named() -> None:
    said = words.strays(HARM)
    assert said.startswith(
        "3 of 12 tracks are lost: boat-9 by lidar in scenario 3 (near it in 25 % of 40 scans); "
    )
    assert said.endswith("Lost at other shares of the scans: 3 at 50 %, 3 at 95 %.")
    assert words.strays(MANY).startswith("none of 9 tracks is lost.")
    only_other = FEW.assign(stays_white=True)
    assert "1 of 4 tracks is lost" in words.strays(only_other)
    assert "but kept with white noise" in words.strays(only_other) and "but kept" not in words.strays(FEW)
    softer = HARM.assign(share_with_target=HARM["share_with_target"].where(HARM["stays"], 0.6))
    assert "0 at 50 %, 3 at 95 %" in words.strays(softer)
    unseen = HARM.assign(share_with_target=HARM["share_with_target"].where(HARM["stays"]))
    assert "boat-9 by lidar in scenario 3 (never seen)" in words.strays(unseen)


def test_hindsight_is_said_to_be_hindsight() -> None:
    rows = made("lidar", ["gained", "spoilt", "neither inside"])
    better = made("lidar", ["spoilt", "spoilt", "gained"], fixed="coloured").query("filter == 'coloured'")
    hind = with_hindsight(pd.concat([rows, better]), words.KEYS)
    said = words.hindsight_words(hind, judged(rows))
    assert said.startswith("With hindsight:") and "2 of 3 would gain (differenced 1, Schmidt 1), " in said
    assert "the one filter has 1 of 3" in said
    better = made("lidar", ["gained", "spoilt", "gained"], fixed="coloured").query("filter == 'coloured'")
    both = words.hindsight_words(with_hindsight(pd.concat([rows, better]), words.KEYS), judged(rows))
    assert "(differenced 2, Schmidt 1; 1 with more than one)" in both
    none = made("lidar", ["spoilt", "spoilt"])
    said = words.hindsight_words(with_hindsight(none, words.KEYS), judged(none))
    assert "0 of 2 would gain, where the one filter has 0 of 2" in said


def test_whether_the_drawn_boat_is_typical() -> None:
    assert "lidar: spoilt (8 of 12 tracks)" in words.drawn_words(HARM, "scenario-3", "boat-0")
    assert "lidar: gained (1 of 12 tracks)" in words.drawn_words(HARM, "scenario-3", "boat-8")
    assert words.drawn_words(HARM, "scenario-2", "boat-0") == "It was tuned on, and is not judged."


def test_nothing_of_use_is_a_page_all_the_same(report: Report) -> None:
    rows = made("ir", ["lost"] * 2)
    use = of_use(rows)
    useful = rows[rows["sensor"].isin(use.loc[use["of_use"], "sensor"])]
    found, hind = judged(useful), with_hindsight(useful, words.KEYS)
    assert words.strays(found).startswith("none of 0 tracks")
    assert "0 of 0 would gain" in words.hindsight_words(hind, found)
    report.table(tables.outcomes_table(found))
    report.table(tables.filters_table(useful, "schmidt"))
    tables.record_outcomes(report, found, use, "schmidt")
    figure, *_ = charts.mean_nees_shown(rows, found, "schmidt")
    assert figure.axes[0].get_title(loc="left").startswith("Tracks of 0 that stay")


def test_tables_count_every_track() -> None:
    rows = tables.outcomes_table(FEW).set_index("sensor")
    assert rows["tracks"].to_dict() == {"lidar": 3, "radar": 1, "all": 4}
    assert rows.loc["all"].tolist() == [4, 1, 0, 0, 0, 2, 1]
    assert (rows.drop(columns="tracks").sum(axis=1) == rows["tracks"]).all()
    held = tables.filters_table(made("lidar", ["gained", "lost"]), "schmidt")
    assert held["filter"].tolist() == ["Schmidt (held fixed)", "differenced", "thinned"]
    assert held["gained"].tolist() == [1, 0, 0] and held["tracks"].tolist() == [2, 0, 0]
    every = tables.cases_table(FEW)
    assert every["words"].tolist() == ["gained", "spoilt", "spoilt", "lost"]
    assert every["near"].tolist()[-1] == "25 % of 40" and every["bound"].tolist()[0] == "1.0 to 3.0"


def test_outcomes_are_recorded_with_their_denominator(report: Report) -> None:
    use = of_use(made("ir", ["lost"] * 5))
    tables.record_outcomes(report, FEW, use, "schmidt")
    found = {(m["name"], m["subject"]): (m["value"], m["n"]) for m in report._metrics}
    assert found["tracks_gained", "schmidt/lidar"] == (1, 3)
    assert found["tracks_spoilt", "schmidt/all-sensors"] == (2, 4)
    assert found["tracks_lost", "schmidt/radar"] == (1, 1)
    assert found["tracks_kept_at_best", "ekf/ir"] == (0, 5)
    report.save()


def test_overview_is_of_the_tracks_that_stay(tracks: pd.DataFrame) -> None:
    rows = tables.overview(tracks).set_index(["sensor", "filter"])
    assert rows.loc[("lidar", "white noise"), "kept"] == "1 of 2"
    assert rows.loc[("lidar", "white noise"), "rmse"] == pytest.approx(4.0)
    assert rows.loc[("lidar", "white noise"), "rmse_all"] == pytest.approx(22.0)
    assert rows.loc[("lidar", "white noise"), "inside"] == "0 of 1"
    assert rows.loc[("lidar", "Schmidt"), "inside"] == "1 of 1"
    assert rows.loc[("colour camera", "Schmidt"), ["kept", "inside"]].tolist() == ["0 of 1", "—"]


def test_tracks_have_their_counts_beside_every_share(tracks: pd.DataFrame) -> None:
    rows = tables.tracks_table(tracks, "lidar").set_index(["target", "filter"])
    assert rows.loc[("a", "kf"), ["near", "kept"]].tolist() == ["100 % of 60", "yes"]
    assert rows.loc[("b", "kf"), ["near", "kept"]].tolist() == ["0 % of 60", "no"]
    assert rows.loc[("a", "kf"), "inside"] == "0 % of 60"


def test_claims_sensor_by_sensor_on_the_tracks_that_stay(tracks: pd.DataFrame) -> None:
    claims = load_claims("autoferry")
    texts = {claim["id"]: claim["text"] for claim in claims}
    rows = tables.claims_by_sensor(tracks, texts).set_index("claim")
    assert len(rows) == len(texts)
    over = rows.loc[texts["white-noise-overconfident"]]
    assert (over["lidar"], over["colour camera"], over["radar"]) == ("1 of 1", "—", "—")
    true = check_claims(tracks, words.KEYS)
    decided = tables.claims_table(pd.DataFrame({"claim": list(texts.values())}), claims, true)
    assert decided["count"].tolist()[0] == "2 of 3"
    kept = tracks[(tracks["sensor"] == "lidar") & (tracks["target"] == "a")]
    assert words.claims_caption(tracks, kept).startswith("Decided on the 1 of 3 cases")


def test_remarks_turn_with_the_innovations() -> None:
    rows = made("lidar", ["gained"] * 4, fixed="coloured")
    low = words.remarks(rows)
    assert "in 4 of 4 tracks it is below its band" in low[0] and "and in 0 above" in low[0]
    high = words.remarks(rows.assign(anis=9.0))
    assert "in 0 of 4 tracks it is below its band" in high[0] and "and in 4 above" in high[0]
    assert "9.00 in the median, where 2 is right" in high[0]
    less, more = (
        words.remarks(rows.assign(lag1_autocorrelation_north=lag, lag1_autocorrelation_east=0.0))[1]
        for lag in (0.5, -0.5)
    )
    assert "negatively in 0 " in less and "positively in 4 " in less
    assert "negatively in 4 " in more and "positively in 0 " in more
    thinned = made("lidar", ["gained", "too dear"], fixed="thinned")
    assert words.remarks(thinned)[-1].endswith("in 1 of 2 cases.")


def test_offsets_say_how_far_they_lie_apart() -> None:
    again = pd.DataFrame(
        {"sensor": ["lidar", "radar"], "scenario 2": [-1.0, -2.0], "scenario 3": [-1.1, -0.5]}
    )
    said = words.offsets_caption(again, "scenario-2")
    assert (
        "only that of scenario 2 is used" in said
        and "lidar: within 0.1 s" in said
        and "radar: within 1.5 s" in said
    )
    assert words.signed(-0.126) == "−0.13"
    assert "scenario 2 alone" in words.method_text("scenario 2")


def test_the_filter_is_named_with_where_it_was_chosen() -> None:
    for name, said in (("schmidt", "That is: Schmidt."), ("coloured", "That is: differenced.")):
        assert words.chosen_words(name, "scenario-2").endswith(said)


def test_nees_over_time_shows_each_filter_and_the_band(
    followed: list[SensorTrack], tracks: pd.DataFrame
) -> None:
    mine = [one for one in followed if (one.sensor, one.target) == ("lidar", "a")]
    rows = tracks[(tracks["sensor"] == "lidar") & (tracks["target"] == "a")]
    figure, name, alt, caption = charts.nees_shown("lidar", mine, rows)
    (ax,) = figure.axes
    assert ax.get_yscale() == "log"
    low, high = chi_square_interval(2)
    assert ax.get_ylim()[0] < low < high < ax.get_ylim()[1]
    labelled = [line for line in ax.get_lines() if not line.get_label().startswith("_")]
    np.testing.assert_array_equal(labelled[0].get_ydata(), mine[0].nees)
    assert [line.get_label() for line in labelled] == ["white noise", "differenced", "Schmidt"]
    assert name == "nees-lidar"
    assert ax.get_title(loc="left") == "Lidar: most often inside is differenced and Schmidt"
    assert "Schmidt 100 % of 60 scans" in caption
    swapped = rows.assign(fraction_nees_inside=[0.9, 0.2, 0.1])
    turned = charts.nees_shown("lidar", mine, swapped)
    assert turned[0].axes[0].get_title(loc="left") == "Lidar: most often inside is white noise"
    assert "Schmidt 10 % of 60 scans" in turned[2]
    strayed = charts.nees_shown("lidar", mine, rows.assign(share_with_target=0.1))
    assert "no track stays" in strayed[0].axes[0].get_title(loc="left")
    assert "95 percent band" in alt


def test_innovations_beside_the_band_of_white_noise(
    followed: list[SensorTrack], tracks: pd.DataFrame
) -> None:
    mine = [one for one in followed if (one.sensor, one.target) == ("lidar", "a")]
    rows = tracks[(tracks["sensor"] == "lidar") & (tracks["target"] == "a")]
    figure, *_ = charts.innovations_shown("lidar", mine, rows)
    (ax,) = figure.axes
    assert len(ax.get_lines()) == 4
    assert all(line.get_ydata()[0] == pytest.approx(1.0) for line in ax.get_lines())


def test_mean_nees_of_all_tracks(tracks: pd.DataFrame) -> None:
    lidar = tracks[tracks["sensor"] == "lidar"]
    figure, _, alt, caption = charts.mean_nees_shown(
        tracks, outcomes(lidar, words.KEYS, "schmidt"), "schmidt"
    )
    (ax,) = figure.axes
    assert (
        ax.get_title(loc="left")
        == "Tracks of 1 that stay and know their error:\n1 with Schmidt, 0 with white noise"
    )
    assert "4 of 7 are of lost tracks. Tracks of 1 that stay" in alt and "4 of 7 hollow" in caption
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["lidar", "colour\ncamera"]
    lost = [line for line in ax.lines if line.get_markerfacecolor() == "white"]
    assert sum(len(line.get_xdata()) for line in lost) == 4
    kept = tracks.assign(share_with_target=1.0, nees_low=0.0, nees_high=1000.0)
    other = charts.mean_nees_shown(kept, outcomes(kept, words.KEYS, "coloured"), "coloured")
    assert other[0].axes[0].get_title(loc="left").endswith("2 with differenced, 2 with white noise")
    assert "0 of 7 are of lost tracks" in other[2]


def test_a_map_counts_the_tracks_that_stay(followed: list[SensorTrack], tracks: pd.DataFrame) -> None:
    nav = pd.DataFrame({"time_s": [0.0, 9.0], "north_m": [0.0, 5.0], "east_m": [0.0, 5.0]})
    truth = nav.assign(target_id="a")
    manifest = make_manifest(
        {
            "name": "made-up",
            "kind": "logged",
            "origin": {"latitude_deg": 63.0, "longitude_deg": 10.0, "height_m": 0.0},
            "platform": {"name": "ferry"},
            "time": {"kind": "utc", "epoch": "2024-05-04T12:00:00Z"},
        }
    )
    flight = Flight(manifest, {"own": nav}, {"truth": truth})
    shown = charts.map_shown("scenario-3", flight, followed, tracks, "coloured")
    title = shown[0].axes[0].get_title(loc="left").replace("\n", " ")
    assert title == "Scenario 3: tracks that stay lidar 1 of 2, colour camera 0 of 1"
    assert "lidar 1 of 2, colour camera 0 of 1" in shown[2]
    assert "positions: differenced; bearings: white noise" in shown[3]
    turned = charts.map_shown("scenario-3", flight, followed, tracks.assign(share_with_target=1.0), "schmidt")
    assert "lidar 1 of 1, colour camera 1 of 1" in turned[2] and "bearings: Schmidt" in turned[3]
