"""What `import wildlab` offers: light, typed as it is imported, short when printed, silent on places."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import chi2

import wildlab
from wildlab import paths
from wildlab.analysis.navigate import PUBLISHED_LIKE
from wildlab.api.flights import Points
from wildlab.evaluation.consistency import Series, chi_square_interval, mean_of_runs, worth
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin

HEAVY = ("numpy", "pandas", "matplotlib", "scipy", "numba", "cv2", "pydantic", "pyarrow", "click")


def loaded_by(code: str) -> set[str]:
    """Which modules a fresh interpreter has after running some code."""
    command = [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"]
    done = subprocess.run(command, cwd=paths.ROOT, capture_output=True, text=True, check=True, timeout=300)
    return set(done.stdout.split())


@pytest.fixture(scope="module")
def ship() -> Flight:
    return simulate_twin("large-ship", 1)


def test_it_is_light_until_something_is_asked_of_it():
    loaded = loaded_by("import wildlab\nassert 'track' in dir(wildlab)")
    assert "wildlab.lazy" in loaded
    assert not loaded & set(HEAVY)


def test_a_name_loads_only_its_own_room():
    loaded = loaded_by("import wildlab\nwildlab.load_flight")
    assert {"pandas", "wildlab.flight.store"} <= loaded
    assert not loaded & {"matplotlib", "numba", "wildlab.simulation", "wildlab.tracking", "wildlab.api"}


def test_its_three_lists_agree():
    tree = ast.parse(Path(str(wildlab.__file__)).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {
        alias.name: f"{node.module}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    always = {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert set(typed) | (always & {"WildlabError"}) == set(wildlab.__all__)
    assert set(wildlab.__all__) <= set(dir(wildlab))
    for name, home in typed.items():
        assert getattr(wildlab, name) is getattr(importlib.import_module(home), name)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = wildlab.nonsense


def test_no_name_hides_a_module():
    folder = Path(str(wildlab.__file__)).parent
    assert not {path.stem for path in folder.iterdir()} & set(wildlab.__all__)


def test_a_printed_flight_names_no_place(ship):
    secret = {"latitude_deg": 61.23456, "longitude_deg": 11.98765, "height_m": 123.4}
    manifest = replace_in_manifest(
        ship.manifest, {"origin": secret, "locations": {"sensitivity": "withheld"}}
    )
    flight = Flight(manifest, ship.nav, ship.tables, Path("/home/somebody/flights/lake"))
    text, html = repr(flight), flight._repr_html_()
    for shown in (text, html, repr(manifest), str(manifest)):
        for number in ("61.2", "11.98", "123.4", "somebody"):
            assert number not in shown
    places = ship.table("truth")["north_m"].to_numpy()
    assert not {f"{place:.1f}" for place in places} & set(re.findall(r"-?\d+\.\d", text)) - {"240.0"}


def test_hostile_names_are_harmless(ship):
    evil = "<script>alert(1)</script>\x1b[2J"
    flight = Flight(ship.manifest, {evil: ship.nav["truth"]}, {})
    assert "<script" not in flight._repr_html_() and "\x1b" not in flight._repr_html_()
    assert "\x1b" not in repr(flight)
    points = Points(flight, evil, pd.DataFrame({c: [1.0] for c in ("north_m", "cov_nn", "cov_ne", "cov_ee")}))
    assert "<script" not in points._repr_html_() and "\x1b" not in repr(points)


def test_points_and_their_errors(ship):
    points = wildlab.georeference(ship)
    errors = wildlab.evaluate_points(points)
    assert errors.summary.n == len(ship.table("detections")) == len(points.table)
    assert errors.summary.mean == pytest.approx(errors.table["error_m"].mean())
    again = wildlab.georeference(ship, source="autopilot")
    pd.testing.assert_frame_equal(points.table, again.table)
    two = replace(ship, nav=ship.nav | {"observer": ship.nav["autopilot"]})
    pd.testing.assert_frame_equal(wildlab.georeference(two).table, points.table)
    with pytest.raises(wildlab.WildlabError, match="nav source"):
        wildlab.georeference(two, source="other")


def test_correlated_values_are_worth_less():
    rng = np.random.default_rng(1)
    white = rng.chisquare(2, 2000)
    slow = np.repeat(rng.chisquare(2, 40), 50)
    assert worth(white) > 1000
    assert worth(slow) < 80
    assert worth([]) == 0.0
    assert worth(np.full(9, np.nan)) == 0.0
    mean = mean_of_runs([Series("NIS", 2, np.arange(2000.0), slow, worth(slow))])
    assert mean.high - mean.low > 10 * (lambda band: band[1] - band[0])(chi_square_interval(2, runs=2000)) / 2


def test_means_of_unlike_runs_lie_in_their_band_as_often_as_it_says():
    """A thousand values that are worth twenty beside a thousand that are worth all: an honest filter's."""
    rng, inside = np.random.default_rng(2), 0
    for _ in range(400):
        slow, white = np.repeat(rng.chisquare(2, 20), 50), rng.chisquare(2, 1000)
        runs = [Series("NIS", 2, np.arange(1000.0), one, n) for one, n in ((slow, 20.0), (white, 1000.0))]
        inside += mean_of_runs(runs).inside
    assert 0.92 < inside / 400 < 0.98


@pytest.mark.slow
def test_every_result_has_a_figure(ship):
    points = wildlab.georeference(ship, source="autopilot")
    track = wildlab.track(ship, source="autopilot")
    for result in (ship, points, wildlab.evaluate_points(points), track, wildlab.consistency(track)):
        figure = wildlab.plot(result)
        assert figure._repr_png_()[1:4] == b"PNG"  # type: ignore[attr-defined]
        assert all(len(ax.lines) + len(ax.patches) for ax in figure.axes)


def test_an_ellipse_lies_as_its_covariance(ship):
    row = {"north_m": [0.0], "east_m": [0.0], "cov_nn": [100.0], "cov_ne": [0.0], "cov_ee": [1.0]}
    (patch,) = wildlab.plot(Points(ship, "truth", pd.DataFrame(row))).axes[0].patches
    box = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
    assert box.height == pytest.approx(10 * box.width)
    assert box.height == pytest.approx(2 * 10 * np.sqrt(chi2.ppf(0.9, 2)))


@pytest.mark.slow
def test_the_script_in_the_readme_runs(tmp_path):
    readme = (paths.ROOT / "README.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", readme, re.S)
    assert len([line for line in script.splitlines() if line]) <= 11
    command = [sys.executable, "-c", script]
    environment = {"PYTHONPATH": str(paths.ROOT), "PATH": ""}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "track.png").read_bytes()[1:4] == b"PNG"
    saved = wildlab.load_flight(tmp_path / "flights" / "fast-vessel")
    assert "mekf" in saved.nav and saved.gnss is not None


@pytest.mark.slow
def test_navigation_is_judged_where_it_flies():
    flight = simulate_twin("fast-vessel", 1)
    before = set(flight.nav)
    nav = wildlab.navigate(flight)
    assert set(flight.nav) == before and set(nav.flight.nav) == before | {"mekf"}
    assert nav.reference == "truth-payload" and nav.part[0] == "in the air"
    honest = wildlab.consistency(nav)
    assert list(honest.means) == ["NEES position", "NEES velocity", "NEES attitude"]
    assert all(series[0].dof == 3 for series in honest.series.values())
    assert all(0.3 < mean.mean < 9 for mean in honest.means.values())
    assert wildlab.plot(nav).axes and wildlab.plot(honest).axes
    with pytest.raises(wildlab.WildlabError, match="tuning"):
        wildlab.navigate(flight, method="observer", tuning=PUBLISHED_LIKE)
    assert wildlab.navigate(flight, method="observer").source == "observer"
