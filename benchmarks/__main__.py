"""Run every benchmark and print its ratios: ``python -m benchmarks``.

Ratios are of one run on one machine. Those of ``baseline.json`` stand beside them; ``--keep`` writes it anew.
"""

import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks import (
    floating,
    long_flight,
    many,
    navigation,
    particles,
    pixel_to_plane,
    simulation,
    terrain,
    tracking,
    warm,
)

BASELINE = Path(__file__).with_name("baseline.json")
EVERY = (
    *(pixel_to_plane, terrain, navigation, tracking, many, particles, simulation, warm, floating),
    long_flight,
)


def main() -> None:
    console = Console()
    before = json.loads(BASELINE.read_text(encoding="utf-8")) if BASELINE.exists() else {}
    now: dict[str, dict[str, float | None]] = {}
    for benchmark in EVERY:
        title, rows = benchmark.run()
        name = benchmark.__name__.rpartition(".")[2]
        table = Table("what", "time (ms)", "ratio", "before", "wanted", title=title)
        now[name] = {}
        for what, seconds, ratio, wanted in rows:
            kept = before.get(name, {}).get(what)
            shown = "" if kept is None else f"{kept:.2g}"
            table.add_row(what, f"{1000 * seconds:.1f}", f"{ratio:.2g}", shown, wanted)
            now[name][what] = float(f"{ratio:.3g}") if ratio == ratio else None
        console.print(table)
    if "--keep" in sys.argv:
        BASELINE.write_text(json.dumps(now, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        console.print(f"kept: {BASELINE.name}")


main()
