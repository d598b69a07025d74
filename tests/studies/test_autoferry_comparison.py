"""What counts as a gain on a track: every outcome by hand, and no track left out."""

from __future__ import annotations

import pandas as pd

from tests.studies.claims import checks_of
from wildlab.studies.autoferry import (
    MOSTLY,
    OUTCOMES,
    PRICE,
    beside_white,
    choose_filter,
    kept_cases,
    of_use,
    outcomes,
    stays,
)

KEYS = ["sensor", "target", "case"]
NAN = float("nan")


def row(
    target: str,
    name: str,
    anees: float,
    *,
    rmse: float = 2.0,
    share: float = 1.0,
    sensor: str = "lidar",
    kind: str = "position",
    anis: float = 2.0,
    lag1: float = 0.5,
    case: str = "scenario-3",
) -> dict[str, object]:
    """A track whose mean NEES should lie between 1 and 3."""
    return {
        "sensor": sensor, "target": target, "case": case, "kind": kind, "filter": name, "rmse": rmse,
        "anees": anees, "anees_alone": anees,
        "nees_low": 1.0, "nees_high": 3.0, "anis": anis, "nis_low": 1.5, "nis_high": 2.5,
        "share_with_target": share, "compared": 60, "detections": 40,
        "lag1_autocorrelation": lag1,
    }  # fmt: skip


#: Outcome -> mean NEES with white noise and with the other filter; the other's RMSE (white: 2 m) and share of
#: the scans near the boat.
CASES = {
    "gained": (9.0, 2.0, 2.0 * PRICE, 1.0),
    "too dear": (9.0, 2.0, 2.01 * PRICE, 1.0),
    "both inside": (1.0, 3.0, 9.0, 1.0),
    "neither inside": (9.0, 3.01, 1.0, MOSTLY),
    "spoilt": (2.0, 0.99, 1.0, 1.0),
    "lost": (9.0, 2.0, 2.0, MOSTLY - 0.01),
}


def cases(name: str = "schmidt") -> pd.DataFrame:
    rows = []
    for target, (white, other, rmse, share) in CASES.items():
        rows += [row(target, "kf", white), row(target, name, other, rmse=rmse, share=share)]
    return pd.DataFrame(rows)


def test_every_track_has_exactly_one_outcome():
    found = outcomes(cases(), KEYS, "schmidt").set_index("target")
    assert found["outcome"].to_dict() == {name: name for name in CASES}
    assert set(CASES) == set(OUTCOMES)


def test_a_track_that_never_began_is_lost_and_counted():
    table = pd.DataFrame(
        [
            row("a", "kf", NAN, rmse=NAN, share=0.0),
            row("a", "schmidt", NAN, rmse=NAN, share=0.0),
            row("b", "kf", NAN, rmse=NAN, share=NAN),  # never seen
            row("b", "schmidt", NAN, rmse=NAN, share=NAN),
        ]
    )
    found = outcomes(table, KEYS, "schmidt")
    assert found["outcome"].tolist() == ["lost", "lost"]
    assert not stays(table).any()
    assert beside_white(table, KEYS).empty


def test_the_fixed_filter_is_the_nearest_its_ideal_that_is_cheap_enough():
    def table(**anees_rmse: tuple[float, float]) -> pd.DataFrame:
        rows = [row("a", "kf", 9.0)]
        return pd.DataFrame(
            rows + [row("a", name, nees, rmse=rmse) for name, (nees, rmse) in anees_rmse.items()]
        )

    assert (
        choose_filter(table(coloured=(3.0, 2.0), schmidt=(2.5, 2.0), thinned=(5.0, 2.0)), KEYS) == "schmidt"
    )
    assert (
        choose_filter(table(coloured=(3.0, 2.0), schmidt=(2.5, 2.3), thinned=(5.0, 2.0)), KEYS) == "coloured"
    )
    # Nor do bearings, whatever a filter makes of them.
    bearing = {"sensor": "eo", "kind": "bearing"}
    camera = [row("a", "ekf", 9.0, **bearing), row("a", "thinned", 2.0, **bearing)]  # type: ignore[arg-type]
    positions = table(coloured=(3.0, 2.0), schmidt=(2.5, 2.0), thinned=(5.0, 2.0))
    assert choose_filter(pd.concat([positions, pd.DataFrame(4 * camera)]), KEYS) == "schmidt"
    # What is assumed of the truth decides nothing.
    assert choose_filter(positions.assign(anees=9.0), KEYS) == "schmidt"
    # What follows something else decides nothing.
    lost = table(coloured=(2.0, 2.0), schmidt=(9.0, 2.0)).assign(share_with_target=0.1)
    assert choose_filter(lost, KEYS) == "coloured"
    kept = table(coloured=(9.0, 2.0), schmidt=(2.0, 2.0)).assign(target="b")
    assert choose_filter(pd.concat([lost, kept]), KEYS) == "schmidt"


def test_a_sensor_is_of_use_where_a_filter_keeps_most_of_its_tracks():
    def camera(kept: int, of: int) -> pd.DataFrame:
        shares = [1.0 if k < kept else 0.0 for k in range(of)]
        white = [row(str(k), "ekf", 2.0, sensor="eo", kind="bearing", share=0.0) for k in range(of)]
        other = [
            row(str(k), "schmidt", 2.0, sensor="eo", kind="bearing", share=share)
            for k, share in enumerate(shares)
        ]
        return pd.DataFrame(white + other)

    for kept, use in ((0, False), (4, False), (5, True)):
        (found,) = of_use(camera(kept, 8)).to_dict(orient="records")
        assert (found["kept"], found["tracks"], found["of_use"]) == (kept, 8, use)
        assert found["filter"] == ("schmidt" if kept else "ekf")


def test_claims_are_decided_case_by_case_and_means_by_the_band_of_a_mean():
    table = pd.DataFrame(
        [
            row("a", "kf", 8.0, rmse=4.0, anis=2.4, lag1=0.6),
            row("a", "coloured", 1.0, rmse=4.2, lag1=-0.3),
            row("a", "schmidt", 2.0, rmse=5.0),
            # Inside the band of single values (0.05 to 7.4), and outside that of a mean.
            row("b", "kf", 2.0, anis=0.5, lag1=0.1),
            row("b", "coloured", 0.5, rmse=1.9, lag1=-0.3),
            row("b", "schmidt", 2.5, rmse=2.0),
            row("c", "kf", NAN, rmse=NAN, anis=NAN),
            row("c", "coloured", NAN, rmse=NAN),
        ]
    )
    checks = checks_of("autoferry", table)
    assert checks["white-noise-overconfident"].holds().tolist() == [True, False]
    assert checks["white-noise-nis-within"].holds().tolist() == [True, False]
    assert checks["white-noise-nis-low"].holds().tolist() == [False, True]
    assert checks["differencing-whitens"].holds().tolist() == [True, False]
    assert checks["differencing-nearer-ideal"].holds().tolist() == [True, False]
    assert checks["differencing-costs-accuracy"].holds().tolist() == [True, False]
    assert checks["schmidt-nearer-ideal"].holds().tolist() == [True, False]
    assert checks["schmidt-as-accurate"].holds().tolist() == [False, True]


def test_only_cases_that_white_noise_keeps_decide():
    table = pd.DataFrame(
        [
            row("a", "kf", 2.0), row("a", "schmidt", 2.0, share=0.1),
            row("b", "kf", 2.0, share=0.1), row("b", "schmidt", 2.0),
        ]
    )  # fmt: skip
    assert kept_cases(table, KEYS)[["target", "filter"]].to_numpy().tolist() == [
        ["a", "kf"],
        ["a", "schmidt"],
    ]
