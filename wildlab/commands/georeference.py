"""A flight's detections on the ground, as a table or for a map."""

from __future__ import annotations

from pathlib import Path

import click

from wildlab.commands.shared import FILE, FOLDER, terminal_console
from wildlab.errors import WildlabError
from wildlab.terminal import shown, stopped


@click.command(short_help="Where a flight's detections lie on the ground.")
@click.argument("flight", type=FOLDER)
@click.option(
    "--into", type=FILE, required=True, help="The file to write: .csv (metres); .geojson or .gpkg (places)."
)
@click.option("--overwrite", is_flag=True, help="Replace the file that is there.")
@click.option("--source", help="Which poses, where the flight has several (its nav/NAME.parquet).")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=1, show_default=True)
def georeference(flight: Path, into: Path, overwrite: bool, source: str | None, seed: int) -> None:
    """Put the pixel detections of FLIGHT on the ground, each with its 90 % ellipse.

    On its terrain where it has one, else on a level plane at the height of each target. A CSV holds metres
    north and east of the flight's origin and no coordinates; a GeoJSON and a GeoPackage hold the places
    themselves, so send them to nobody who may not know them. A GeoPackage has the ellipses as a layer of
    their own, and opens in QGIS as it is.

    \b
    Examples:
      wildlab georeference flights/tuesday --into points.csv
      wildlab georeference flights/tuesday --into points.geojson
      wildlab georeference flights/tuesday --into points.gpkg
    """
    import numpy as np

    from wildlab.analysis.georeference import georeference as to_ground
    from wildlab.analysis.georeference import observe
    from wildlab.analysis.ground import SUFFIXES, ground_sentences, write_points
    from wildlab.flight.store import load_flight
    from wildlab.runner.evaluate import tell_source

    if into.suffix not in SUFFIXES:
        raise WildlabError(
            f"nobody knows how to write {into.suffix!r}", f"end it with {' or '.join(SUFFIXES)}", file=into
        )
    if into.exists() and not overwrite:
        raise WildlabError("this file is there already", "name another, or add --overwrite", file=into)
    data = load_flight(flight)
    name, _ = data.pose_source(source)
    tell_source(data, source, terminal_console())
    observations = observe(data, name)
    points = to_ground(observations, np.random.default_rng(seed))
    write_points(data, points, into, name)
    for line in ground_sentences(observations, points):
        click.echo(stopped(line))
    click.echo(shown(into))
