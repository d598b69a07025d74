"""Every number that wildlab gives, kept and compared: whether a change of structure has moved any.

::

    python tools/golden.py keep before --data ../data      # with the code as it was
    python tools/golden.py keep after --data ../data       # with the code as it is
    python tools/golden.py compare before after            # what moved by more than 1e-12 of itself

``keep`` runs every study over three flights, and every public and some simulated flights through the
commands. What is finished is not run again; ``--only tracked studies`` runs the steps whose names begin so.
``--data`` is a folder as ``WILDLAB_DATA_MIRROR`` names it. Numbers are those of the files that commands leave
(tables, ``metrics.json``, cells of tables on pages), not words. Exit code 1 where one moved, came or went.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
#: How far a number may move, as a part of its size.
TOLERANCE = 1e-12
#: Public flights by recipe, with the folder of their raw files below the data.
PUBLIC = {
    "openathena": "georeferencing/openathena",
    "openathena-f1": "georeferencing/openathena-f1",
    "umn-thor75": "logs/umn_thor75",
    "inertialnav-x8": "logs/inertialnav_x8",
    **{f"autoferry-{k}": "tracking/autoferry" for k in (2, 3, 5, 13, 17)},
}
SIMULATED = ("static-antenna", "fast-vessel", "crossing-vessels", "uav-tracking")
FERRY = ["--settings", "data/settings/autoferry.toml"]
FENCE = {
    "type": "Polygon",
    "coordinates": [[[10.39, 63.42], [10.394, 63.42], [10.394, 63.4215], [10.39, 63.4215], [10.39, 63.42]]],
}
#: Files of a run that are no result: times, digests, versions.
NO_RESULT = ("status.json", "provenance.json", "checksums.json", "digests.json")
_CELL = re.compile(r"<t[dh][^>]*>(.*?)</t[dh]>", re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\d.])")


class Step(NamedTuple):
    """A command, by a name; ``{data}`` and ``{work}`` stand for folders."""

    name: str
    command: list[str]


def steps() -> Iterator[Step]:
    """All commands, in the order in which they are run."""
    for name, raw in PUBLIC.items():
        recipe = f"data/recipes/{name}.toml"
        yield Step(
            f"imported-{name}", ["import", recipe, "--source", f"{{data}}/{raw}", "--out", _flight(name)]
        )
    for name in SIMULATED:
        yield Step(f"imported-{name}", ["simulate", name, "--seed", "3", "--out", _flight(name)])
    for name in (*PUBLIC, *SIMULATED):
        yield Step(f"checked-{name}", ["check", "--json", _flight(name)])
        yield Step(f"evaluated-{name}", ["evaluate", _flight(name), "--out", _out("evaluated", name)])
        yield Step(
            f"placed-{name}", ["georeference", _flight(name), "--out", _out("placed", name) + "/points.csv"]
        )
        more = FERRY if name.startswith("autoferry") else []
        yield Step(
            f"tracked-{name}", ["track", _flight(name), "--out", _out("tracked", name) + "/report", *more]
        )
        many = ["track", "--many", _flight(name), "--out", _out("many", name) + "/report", *more]
        yield Step(f"many-{name}", many)
        report = _out("evaluated", name) + f"/{name}"
        copy = ["share", report, "--flight", _flight(name), "--out", _out("shared", name) + "/copy.html"]
        yield Step(f"shared-{name}", copy)
    sight = ["--image", "640x512", "--view", "32", "--height", "60"]
    yield Step("planned", ["plan", "{work}/fence.geojson", *sight, "--out", _out("planned")])
    warm = ["detect", "{data}/imagery/bambi_gatter/thermal", "--method", "warm"]
    yield Step("detected", [*warm, "--out", _out("detected")])
    yield Step("studies", ["run", "--all", "--seeds", "3", "--jobs", "2", "--out", _out("studies")])


def _flight(name: str) -> str:
    return f"{{work}}/flights/{name}"


def _out(step: str, name: str = "") -> str:
    return f"{{work}}/out/{step}-{name}" if name else f"{{work}}/out/{step}"


def keep(work: Path, data: Path, only: tuple[str, ...]) -> None:
    """Run what has not been run yet, and keep all numbers in ``numbers.parquet``."""
    work.mkdir(parents=True, exist_ok=True)
    (work / "fence.geojson").write_text(json.dumps(FENCE))
    done_file = work / "done.json"
    done: dict[str, Any] = json.loads(done_file.read_text()) if done_file.exists() else {}
    wanted = [one for one in steps() if not only or one.name.startswith(only)]
    for index, step in enumerate(wanted, 1):
        if step.name in done:
            continue
        out = work / "out" / step.name
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        command = [part.format(data=data, work=work) for part in step.command]
        began = time.monotonic()
        environment = {**os.environ, "WILDLAB_DATA_MIRROR": str(data), "PYTHONPATH": str(ROOT)}
        ran = subprocess.run(  # noqa: S603
            [sys.executable, "-m", "wildlab", *command],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        (out / "printed.json" if step.name.startswith("checked") else out / "printed.txt").write_text(
            ran.stdout
        )
        done[step.name] = {"code": ran.returncode, "seconds": round(time.monotonic() - began, 1)}
        done_file.write_text(json.dumps(done, indent=1))
        told = (
            f"  {ran.stderr.strip().splitlines()[-1][:150]}" if ran.returncode and ran.stderr.strip() else ""
        )
        print(f"{index} of {len(wanted)}  {step.name}  exit {ran.returncode}{told}", flush=True)
    rows = [*_numbers_below(work / "flights"), *_numbers_below(work / "out")]
    rows += [(f"exit code/{name}", 0, float(one["code"])) for name, one in sorted(done.items())]
    table = pd.DataFrame(rows, columns=["key", "row", "value"]).astype({"key": "category"})
    table.to_parquet(work / "numbers.parquet")
    print(f"{len(table)} numbers, {table['key'].nunique()} columns: {work / 'numbers.parquet'}")


def _numbers_below(folder: Path) -> Iterator[tuple[str, int, float]]:
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder.parent).parts
        if path.is_dir() or path.name in NO_RESULT or any(part.startswith(".") for part in parts):
            continue
        key = "/".join(parts)
        for name, values in _columns(path):
            for row, value in enumerate(values):
                yield f"{key}:{name}", row, value


def _columns(path: Path) -> Iterator[tuple[str, np.ndarray]]:
    """The numbers of a file, by column."""
    if path.suffix in (".csv", ".parquet"):
        if path.stat().st_size == 0:
            return
        table = pd.read_csv(path, comment="#") if path.suffix == ".csv" else pd.read_parquet(path)
        for name in table.select_dtypes(["number", "bool"]):
            yield str(name), table[name].to_numpy(float)
    elif path.suffix in (".json", ".geojson"):
        for name, value in _leaves(json.loads(path.read_text(encoding="utf-8") or "null"), ""):
            yield name, np.array([value])
    elif path.suffix == ".html":
        cells = " ".join(_CELL.findall(path.read_text(encoding="utf-8"))).replace("\u2212", "-")
        yield "cells", np.array([float(number) for number in _NUMBER.findall(re.sub(r"<[^>]*>", " ", cells))])


def _leaves(content: Any, name: str) -> Iterator[tuple[str, float]]:
    if isinstance(content, dict):
        label = "/".join(str(content[key]) for key in ("subject", "name", "id") if key in content)
        for key, value in content.items():
            yield from _leaves(value, f"{name}/{key}")
        if label:
            return
    elif isinstance(content, list):
        for index, value in enumerate(content):
            own = value if isinstance(value, dict) else {}
            label = "/".join(str(own[key]) for key in ("subject", "name", "id") if key in own)
            yield from _leaves(value, f"{name}[{label or index}]")
    elif isinstance(content, (int, float)):
        yield name, float(content)


def compare(before: Path, after: Path, most: int) -> int:
    """Print what moved, came or went; 1 where anything did."""
    tables = [
        pd.read_parquet(folder / "numbers.parquet").astype({"key": str}).set_index(["key", "row"])["value"]
        for folder in (before, after)
    ]
    both = pd.concat(tables, axis=1, keys=["before", "after"], join="outer", sort=True)
    known = [both.index.isin(table.index) for table in tables]
    both = both.astype(float)
    old, new = both["before"].to_numpy(), both["after"].to_numpy()
    with np.errstate(invalid="ignore"):
        change = np.abs(new - old) / np.maximum(np.fmax(np.abs(old), np.abs(new)), 1e-300)
    same_kind = (old == new) | (np.isnan(old) & np.isnan(new))
    # What is infinite, or known before or after alone, has moved however far.
    moved = known[0] & known[1] & ~same_kind & ~(change <= TOLERANCE)
    for word, rows in (("moved", moved), ("gone", known[0] & ~known[1]), ("new", known[1] & ~known[0])):
        found = both[rows].assign(change=change[rows]).reset_index()
        keys = found.groupby("key", sort=False).agg(
            count=("row", "size"),
            largest=("change", "max"),
            before=("before", "first"),
            after=("after", "first"),
        )
        print(f"{word}: {len(found)} numbers in {len(keys)} columns")
        for one in keys.sort_values("largest", ascending=False).head(most).itertuples():
            first = f"{one.before:.12g} -> {one.after:.12g}"
            print(f"  {one.Index}: {one.count}, by up to {one.largest:.2g}; {first}")
    same = int((known[0] & known[1] & ~moved).sum())
    print(f"equal: {same}")
    return int(same < len(both))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("keep", help="run all, and keep the numbers")
    one.add_argument("folder", type=Path)
    one.add_argument("--data", type=Path, required=True, help="public data")
    one.add_argument("--only", nargs="*", default=[], help="steps whose names begin so")
    two = commands.add_parser("compare", help="print what moved")
    two.add_argument("before", type=Path)
    two.add_argument("after", type=Path)
    two.add_argument("--most", type=int, default=40, help="columns shown of each kind")
    given = parser.parse_args()
    if given.command == "keep":
        keep(given.folder.resolve(), given.data.resolve(), tuple(given.only))
        return 0
    return compare(given.before, given.after, given.most)


if __name__ == "__main__":
    sys.exit(main())
