"""Run every benchmark and print its ratios: ``python -m benchmarks``."""

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
    turns,
    warm,
)


def main() -> None:
    console = Console()
    every = (
        pixel_to_plane,
        turns,
        terrain,
        navigation,
        tracking,
        many,
        particles,
        simulation,
        warm,
        floating,
        long_flight,
    )
    for benchmark in every:
        title, rows = benchmark.run()
        table = Table("what", "time (ms)", "ratio", "wanted", title=title)
        for what, seconds, ratio, wanted in rows:
            table.add_row(what, f"{1000 * seconds:.1f}", f"{ratio:.2g}", wanted)
        console.print(table)


main()
