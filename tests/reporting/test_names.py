"""Names of strangers in figures and tables: shown as they are, never obeyed, and read back as they were."""

from __future__ import annotations

import ast
import io
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

import wildlab
from tests.reporting.test_charts import track
from tests.reporting.test_many_tracks import made
from wildlab.analysis.detectors import TABLE_COLUMNS
from wildlab.files import csv_text, read_csv
from wildlab.names import FORMULA
from wildlab.reporting.charts import drawing, flights, tracks
from wildlab.reporting.detections import precision_over_recall
from wildlab.reporting.figures import _harmless as _harmless_texts
from wildlab.reporting.text import csv_link
from wildlab.runner.annotation import Point, Session

PACKAGE = Path(wildlab.__file__).parent
HOSTILE = [
    "$HOME `id` $(id)",
    "_",
    "_nolegend_",
    "$$",
    r"\frac{",
    "=cmd|calc!A1.jpg",
    "a\u202eb",
    "\x1b[2J",
    "NA",
]
NAMES = st.sampled_from(HOSTILE) | st.text(
    st.characters(codec="utf-8") | st.sampled_from("$_\\{}^=+-@'\"\t,;\u202e\u2066"), min_size=1, max_size=9
).filter(str.strip)
N = 60
TIMES = np.arange(float(N))
WAY = np.column_stack([TIMES, 0.1 * TIMES, np.ones(N), np.ones(N)])


# -- the lint
# ------------------------------------------------------------------------------------------------


def passed_by(source: str) -> list[int]:
    """Lines on which a label of a line or of ticks does not come through the door."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
            given = [word.value for word in node.keywords if word.arg in ("label", "labels")]
            given += node.args[1:2] if name in ("set_xticks", "set_yticks") else []
            found += [node.lineno for one in given if not _harmless(one)]
            found += [node.lineno for word in node.keywords if word.arg in ("parse_math", "usetex")]
        elif isinstance(node, ast.Dict):
            pairs = zip(node.keys, node.values, strict=True)
            found += [
                node.lineno
                for key, value in pairs
                if isinstance(key, ast.Constant) and key.value == "label" and not _harmless(value)
            ]
    return found


def _harmless(value: ast.expr) -> bool:
    """Whether a label is written out, begins with what is written out, or comes through `figure_name`."""
    match value:
        case ast.Constant():
            return True
        case ast.JoinedStr(values=[first, *_]):
            # A number has a format.
            number = isinstance(first, ast.FormattedValue) and first.format_spec is not None
            return number or (isinstance(first, ast.Constant) and not str(first.value).startswith("_"))
        case ast.Subscript(value=ast.Constant()):
            return True  # a letter of what is written out
        case ast.Call(func=ast.Name(id="figure_name")):
            return True
        case ast.IfExp():
            return _harmless(value.body) and _harmless(value.orelse)
        case ast.ListComp():
            return _harmless(value.elt)
    return False


def drawing_files() -> Iterator[Path]:
    yield from sorted((PACKAGE / "reporting").rglob("*.py"))
    yield PACKAGE / "api/plot.py"


def test_labels_of_figures_come_through_the_door():
    lines = [f"{path}:{line}" for path in drawing_files() if "new_figure" in (text := path.read_text())
             for line in passed_by(text)]  # fmt: skip
    assert lines == []
    # One place makes figures, and it takes nothing for maths.
    makers = [path.name for path in PACKAGE.rglob("*.py") if "Figure(figsize" in path.read_text()]
    assert makers == ["figures.py"]


def test_every_table_is_written_through_the_door():
    writers = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if ".to_csv(" in (text := path.read_text()) or "csv.writer" in text or "DictWriter" in text
    }
    assert writers == {"files.py"}


# -- figures
# ------------------------------------------------------------------------------------------------


def figures_of(one: str, other: str) -> Iterator[tuple[Figure, set[str]]]:
    """Every kind of figure that is given names, and the names that its legend must have."""
    rng = np.random.default_rng(1)
    pair = [track("ekf", 10 + rng.normal(size=N)), track("schmidt", 6 + rng.normal(size=N))]
    more: dict[str, Any] = {"innovation": rng.normal(size=(N, 2)), "S": np.tile(np.eye(2), (N, 1, 1))}
    more |= {"nis": rng.chisquare(2, N), "nees": rng.chisquare(2, N), "estimate": WAY}
    pair = [t._replace(sensor=one, target=other, **more) for t in pair]
    rows = pd.DataFrame(
        [
            {"sensor": one, "target": other, "filter": t.filter, "nees": 2.0, "nis": 2.0, "rmse": 3.0}
            for t in pair
        ]
    )
    known: Any = SimpleNamespace(tracks=pair)
    yield tracks.map_shown(known, other, "ekf", WAY[:, :2], {f"{one}x": WAY[:, :2]})[0], {one, f"{one}x"}
    yield tracks.squares_shown(pair, rows, "nees")[0], set()
    yield tracks.errors_shown(pair, rows)[0], set()
    white = tracks.whiteness_shown(pair, ("range", one))
    assert white is not None
    yield white[0], set()
    followed, lives = made(1, tracks=3, looks=12, name=one.replace("{", "").replace("}", "") + "{}")
    for figure in (tracks.tracks_shown(followed), tracks.identities_shown(followed, lives)):
        yield figure[0], set()
    poses = {name: (TIMES, TIMES) for name in (one, f"{other}'")}
    yield flights.strips({"roll (°)": poses, "yaw (°)": poses}), {one, f"{other}'"}
    error = {one: WAY[:, :3]}
    yield flights.error_bands(TIMES, error, error, ["a", "b", "c"]), set()
    clock = flights.Clock(0.0, TIMES[-1])
    yield flights.strips({one: poses}, clock), {one}
    yield tracks.track_map(WAY, {"a": WAY}, {"a": one}), {one}
    yield drawing.rows_chart([one, other], {"": drawing.Values([1.0, 2.0])}, one, size=(4.6, 2.0)), set()
    curves = pd.DataFrame({"detector": [one, one], "recall": [0.1, 0.2], "precision": [1.0, 0.9]})
    yield precision_over_recall([one], curves), {one}
    yield tracks.error_shares({one: (TIMES, "#000000")}), set()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Glyph")
@settings(max_examples=1, deadline=None, derandomize=True, phases=[Phase.explicit, Phase.generate])
@example("_$HOME `id` $(id)\u202e\x1b", "$x_{")
@given(NAMES, NAMES)
def test_figures_show_any_name(one, other):
    for figure, wanted in figures_of(one, other):
        _harmless_texts(figure)
        figure.draw_without_rendering()
        assert_legend(figure, wanted)


def assert_legend(figure: Figure, wanted: set[str]) -> None:
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend() is not None)]
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    for name in wanted:
        assert any(_seen(text).endswith(_seen(name)) for text in texts), (name, texts)
    assert not any(mark in text for text in texts for mark in "\u202e\x1b")


def _seen(text: str) -> str:
    """Letters that are certainly drawn as they are."""
    return "".join(c for c in text if c.isalnum() or c in "$_")


# -- tables
# ------------------------------------------------------------------------------------------------


@settings(deadline=None, derandomize=True)
@given(
    st.lists(NAMES | st.text(st.characters(codec="utf-8", exclude_characters="\0")), min_size=1, max_size=5)
)
def test_tables_give_names_back_and_hold_no_formula(names):
    names = [name.replace("\0", "") for name in names]
    table = pd.DataFrame({"name": names, "=x": range(-len(names), 0)})
    text = csv_text(table)
    plain = pd.read_csv(io.StringIO(text, newline=""), dtype=str, keep_default_na=False)
    assert not any(cell.startswith(FORMULA) for cell in [*plain["name"], *plain.columns])
    again = read_csv(io.StringIO(text, newline=""), ("name",))
    assert again["name"].tolist() == names
    assert again["'=x"].tolist() == table["=x"].tolist()
    assert csv_link(table, "x").startswith("<a")


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.lists(NAMES, min_size=1, max_size=4))
def test_detections_and_clicks_are_read_back_by_name(names):
    from wildlab.flight.readers import read_log
    from wildlab.flight.readers.labels import read_table

    names = [shown for name in names if (shown := "".join(filter(str.isprintable, name)).strip())] or ["a"]
    found = pd.DataFrame({name: 5.0 for name in TABLE_COLUMNS}, index=range(len(names)))
    found = found.assign(frame_id=names, label=names)
    marked = read_table(csv_text(found).encode(), Path("detections.csv"))
    assert set(marked.table["name"]) == set(names)
    points = {f"{name}.jpg": [Point(name, 1.0, 2.0)] for name in names}
    session: Any = SimpleNamespace(points=points)
    part = read_log(Path("clicks.csv"), Session._text(session).encode(), "clicks").parts["clicks"]
    assert set(part.columns["image"]) == set(points) and set(part.columns["name"]) == set(names)
