"""What is constantly wrong with a camera's poses, learnt on one flight and kept for the next."""

from __future__ import annotations

from pathlib import Path

import click

from wildlab.commands.shared import FILE, FOLDER
from wildlab.errors import WildlabError
from wildlab.terminal import print_json, print_table, shown


@click.command(short_help="Learn on a flight's known points what the next one is to be corrected by.")
@click.argument("flight", type=FOLDER)
@click.option("--into", type=FILE, required=True, help="The file to write, calibration.toml for instance.")
@click.option("--overwrite", is_flag=True, help="Replace the file that is there.")
@click.option("--source", help="Which poses, where the flight has several (its nav/NAME.parquet).")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=1, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="What was learnt, as JSON.")
def calibrate(
    flight: Path, into: Path, overwrite: bool, source: str | None, seed: int, as_json: bool
) -> None:
    """Learn on the known points of FLIGHT what is constantly wrong with position, boresight, clock or lens.

    Without truth, things that several images show serve as well. Only what gained something for certain on
    images that it was not estimated from, and nothing else explains as well, is written down, with its
    covariance; how noisy the poses were always is. Judge it on another flight. A flight whose logs contradict
    each other teaches nothing.

    \b
    Examples:
      wildlab calibrate flights/tuesday --into calibration.toml
      wildlab evaluate flights/wednesday --calibration calibration.toml
    """
    import numpy as np

    from wildlab.analysis.learn import learn_flight
    from wildlab.flight.calibration_files import write_learnt
    from wildlab.flight.checks.check import sense_sentences
    from wildlab.flight.store import load_flight
    from wildlab.reporting.georeferencing import simplest_rivals, words_of_causes

    if into.exists() and not overwrite:
        raise WildlabError("this file is there already", "name another, or add --overwrite", file=into)
    loaded = load_flight(flight)
    if problems := [one for one in sense_sentences(loaded) if one.startswith("problem")]:
        raise WildlabError(
            f"its logs contradict each other ({len(problems)} problem{'s' * (len(problems) > 1)})",
            "mend that first (wildlab check says what it is): what is learnt now would spoil other flights",
            file=flight,
        )
    learnt, diagnosis = learn_flight(loaded, np.random.default_rng(seed), source)
    write_learnt(learnt, into)
    if as_json:
        print_json(learnt.model_dump())
        return
    gain = learnt.gain
    causes, possible = diagnosis.winner.causes, diagnosis.winner.gain.gain
    if gain is None and causes and np.isfinite(possible.low):
        click.echo(
            f"Possible, not certain: {words_of_causes(causes)} taken off gains {possible.low:.2f} to "
            f"{possible.high:.2f} m on images that it was not estimated from. The file holds the noise of "
            "the poses alone."
        )
    elif gain is None:
        some = any(model.causes and model.gain.counts for model in diagnosis.models)
        click.echo(
            f"No constant error {'stands out' if some else 'gains anything for certain'} "
            f"({len(diagnosis.models)} models tried): the file holds the noise of the poses alone."
        )
    if gain is None:
        if others := simplest_rivals(diagnosis):
            one, other = words_of_causes(diagnosis.winner.causes), words_of_causes(others[0])
            click.echo(f"These images do not separate {one} from {other}.")
    else:
        click.echo(
            f"{diagnosis.winner.name}: mean error {gain.without_m:.2f} m as logged, {gain.with_m:.2f} m on "
            f"images that it was not estimated from (gain {gain.low_m:.2f} to {gain.high_m:.2f} m)."
        )
        rows = [
            [one.name, f"{one.value:+.3f}", f"{one.low:+.3f} to {one.high:+.3f}", one.unit]
            for one in learnt.parameter
        ]
        print_table(["to be added to", "estimate", "95 % interval", "unit"], rows)
    click.echo(shown(into))
