"""Commands on studies: list, run, vary; and evaluate, which judges a flight by the same notebooks."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import click

from wildlab.commands.shared import FILE, FOLDER, Minutes, reports_folder, terminal_console
from wildlab.terminal import count, print_json, print_table, shown


@click.command("list", short_help="The studies, and where each stands.")
@click.option("--out", type=FOLDER, help="Where the reports are.  [default: reports]")
@click.option("--json", "as_json", is_flag=True, help="As JSON, with every published number and ours.")
@click.option("--rule", is_flag=True, help="How often each answer is right, by simulation of the rule.")
def list_(out: Path | None, as_json: bool, rule: bool) -> None:
    """The studies, and where each stands: published numbers that are close, and within 90 % of our flights.

    \b
    Example:
      wildlab list
    """
    from wildlab.evaluation.shares import HOLDS
    from wildlab.flight.catalog import is_fetched
    from wildlab.reporting.published_tables import tally
    from wildlab.runner.catalogue import load_studies
    from wildlab.runner.record.status import as_plain, study_status

    if rule:
        from wildlab.evaluation.characteristics import operating_characteristics

        table = operating_characteristics(trials=1000)
        if as_json:
            print_json(table.to_dict(orient="records"))
            return
        rows = [[kind, *(f"{value:.2f}" for value in row)] for kind, *row in table.itertuples(index=False)]
        print_table(["kind", "our errors, times", *table.columns[2:]], rows)
        return
    statuses = [study_status(study, reports_folder(out)) for study in load_studies().values()]
    if as_json:
        print_json([as_plain(one) for one in statuses])
        return
    rows = []
    for one in statuses:
        done, data = one.state == "done", one.study.dataset
        holding = sum(claim.verdict == HOLDS for claim in one.claims)
        # What has not been run has neither come out nor failed to.
        printed = len(one.counted)
        found = tally(one.counted)
        close = f"{found.close['close']} of {printed}" if done else f"{printed} published"
        within = found.within if done else ""
        claims = f"{holding} of {len(one.claims)}" if done else f"{len(one.claims)} published"
        first = f"; first: wildlab fetch {data}" if data and not done and not is_fetched(data) else ""
        unsealed = f" ({one.reason})" if one.ran and one.reason else ""
        state = f"{one.state}{unsealed}{first}"
        rows.append(
            [
                one.study.name,
                one.study.kind,
                state,
                close if one.numbers else "-",
                within if one.numbers else "-",
                claims if one.claims else "-",
                one.study.title,
            ]
        )
    print_table(["study", "kind", "state", "close", "within 90 %", "claims hold", "question"], rows)
    damaged = [one for one in statuses if one.state == "damaged"]
    if damaged:
        click.echo(f"{count(len(damaged), 'report')} not as written, and not counted:", err=True)
    for one in damaged:
        click.echo(f"  {one.study.name}: {one.reason}", err=True)


@click.command(short_help="Run studies; each leaves a report.")
@click.argument("studies", nargs=-1, metavar="STUDY...")
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="All studies but those kept apart; those whose data are not here are skipped.",
)
@click.option("--first-look", is_flag=True, help="A few flights of each study, and say so; no full numbers.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="Seed in place of the study's own.")
@click.option(
    "--seeds",
    type=click.IntRange(1, 1_000_000),
    help="Over how many simulated flights, in place of the study's own.",
)
@click.option("--flight", type=FOLDER, help="A flight folder in place of the study's own (one study only).")
@click.option(
    "--jobs",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="How many processes at a time, for notebooks and seeds together.",
)
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Compute the seeds on a dask.distributed cluster; notebooks run here.",
)
@click.option(
    "--timeout",
    type=Minutes(),
    help="Minutes a notebook may take, and each seed.  [default: 30]",
)
@click.option("--out", type=FOLDER, help="Where reports go.  [default: reports]")
def run(
    studies: tuple[str, ...],
    everything: bool,
    first_look: bool,
    seed: int | None,
    seeds: int | None,
    flight: Path | None,
    jobs: int,
    scheduler: str | None,
    timeout: float | None,
    out: Path | None,
) -> None:
    """Run studies; each leaves a report, and the ledger shows them all.

    --all goes over them twice: first every report from few flights, then the full numbers in their place.
    A study that is named runs once, in full; the name of a case (schmidt) stands for all its studies.
    --seeds N is one pass over N flights.

    What was computed for a seed is kept: a run that was broken off goes on where it stopped, and more
    seeds cost only those that are new. The numbers are the same for any --jobs.

    \b
    Examples:
      wildlab run sensitivity consistency-bounds
      wildlab run schmidt --jobs 2
      wildlab run --all --jobs 4
      wildlab run --all --first-look
      wildlab run static-point --seeds 200 --jobs 4
      wildlab run static-point --scheduler tcp://127.0.0.1:8786
    """
    from wildlab.runner.run import run_studies

    if everything and studies:
        raise click.UsageError("Name studies or say --all, not both.")
    if first_look and seeds is not None:
        raise click.UsageError("--first-look has its own number of flights: leave it or --seeds out.")
    outcomes = run_studies(
        studies,
        everything=everything,
        first_look=first_look,
        seed=seed,
        seeds=seeds,
        flight=flight,
        reports=reports_folder(out),
        parallel=jobs,
        scheduler=scheduler,
        timeout_s=None if timeout is None else timeout * 60,
        console=terminal_console(),
    )
    click.echo(shown(reports_folder(out) / "index.html"))
    failed = [outcome.name for outcome in outcomes if outcome.state == "failed"]
    if failed:
        click.echo(f"{len(failed)} of {len(outcomes)} failed: {', '.join(failed)}.", err=True)
        sys.exit(1)


@click.command(short_help="Which verdicts hang on what was chosen for a twin?")
@click.argument("study")
@click.option(
    "--by",
    default="0.5,0.8,1.25,2",
    show_default=True,
    metavar="FACTORS",
    help="By what the parameters are multiplied.",
)
@click.option(
    "--seeds", type=click.IntRange(3, 10_000), default=20, show_default=True, help="Over how many flights."
)
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="How many processes.")
@click.option("--out", type=FOLDER, help="Where reports are.  [default: reports]")
def vary(study: str, by: str, seeds: int, jobs: int, out: Path | None) -> None:
    """Which verdicts of a STUDY hang on what was chosen for its twin?

    Each group of chosen parameters is multiplied, the filters' tuning left alone; the table names the
    verdicts that turn. A moved flight shows its target in as many images as it does, at most in as many as
    are printed. What is computed is kept; the study's report shows the table from its next run on.

    \b
    Examples:
      wildlab vary schmidt-fast-vessel --jobs 2
      wildlab vary coloured-noise-fast --by 0.5,2 --seeds 40
    """
    from wildlab.runner.vary import vary_study

    try:
        factors = [float(one) for one in by.split(",")]
    except ValueError:
        raise click.UsageError(f"--by is {by!r}: give numbers with commas between, 0.5,2.") from None
    console = terminal_console()
    table = vary_study(
        study,
        factors=factors,
        seeds=seeds,
        reports=reports_folder(out),
        parallel=jobs,
        tell=lambda line: console.print(line, highlight=False, soft_wrap=True),
    )
    rows = []
    for group, factor, turned, of, which in table.itertuples(index=False, name=None):
        share = "-" if math.isnan(turned) else f"{turned:.0f} of {of}"
        rows.append([str(group), f"{factor:g}", share, str(which)])
    print_table(["chosen parameters", "times", "turned", "which"], rows)


@click.command(short_help="What is a flight worth? One report for all that its data allow.")
@click.argument("flight", type=FOLDER)
@click.option("--source", help="Which poses to judge, where the flight has several (its nav/NAME.parquet).")
@click.option(
    "--calibration", type=FILE, help="Apply first what `wildlab calibrate` learnt on another flight."
)
@click.option("--out", type=FOLDER, help="Where the report goes.  [default: reports]")
@click.option("--timeout", type=Minutes(), help="Minutes it may take.  [default: 30]")
def evaluate(
    flight: Path, source: str | None, calibration: Path | None, out: Path | None, timeout: float | None
) -> None:
    """What is a flight worth? FLIGHT is a folder made by `wildlab import` or `wildlab simulate`.

    First an overview, whatever the flight lacks: where it flew and what is wrong on the way, what was
    recorded and where it pauses, what the images showed, and the three things most worth fixing, each with
    its measured gain. Then a report on the accuracy of its georeferencing, and one on its navigation, as far
    as the data go.
    All flights evaluated are listed in reports/flights.html.

    \b
    Examples:
      wildlab evaluate flights/tuesday
      wildlab evaluate flights/antenna --source autopilot
      wildlab evaluate flights/wednesday --calibration calibration.toml
    """
    from wildlab.runner.evaluate import evaluate_flight, left_from_before

    reports = reports_folder(out)
    outcomes = evaluate_flight(
        flight,
        source=source,
        calibration=calibration,
        reports=reports,
        timeout_s=None if timeout is None else timeout * 60,
        console=terminal_console(),
    )
    for outcome in outcomes:
        if outcome.folder is not None:
            click.echo(shown(outcome.folder / "report.html"))
    for folder in left_from_before(flight, reports):
        click.echo(
            f"{shown(folder)} is of an earlier evaluation, and was not made again: flights.html says so.",
            err=True,
        )
    if any(outcome.state == "failed" for outcome in outcomes):
        sys.exit(1)
