"""Commands on studies: list, run, vary."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import click

from wildlab.commands import shared
from wildlab.commands.shared import FOLDER, count, print_json, print_table, shown, terminal_console
from wildlab.runner.processes import start_server

jobs = click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes.")


@click.command("list")
@shared.reports
@shared.as_json
@click.option("--rule", is_flag=True, help="How often each answer is right, by simulation.")
def list_(reports: Path, as_json: bool, rule: bool) -> None:
    """The studies, and where each stands.

    How many of its published numbers are close, and within 90 % of our flights.

    \b
    Example:
      wildlab list
    """
    from wildlab.evaluation.shares import HOLDS
    from wildlab.flight.catalog import is_fetched
    from wildlab.reporting.published_tables import tally
    from wildlab.runner.catalogue import load_studies
    from wildlab.runner.status import as_plain, study_status

    if rule:
        from wildlab.evaluation.replication import operating_characteristics

        table = operating_characteristics(trials=1000)
        if as_json:
            print_json(table.to_dict(orient="records"))
            return
        rows = [[kind, *(f"{value:.2f}" for value in row)] for kind, *row in table.itertuples(index=False)]
        print_table(["kind", "our errors, times", *table.columns[2:]], rows)
        return
    statuses = [study_status(study, reports) for study in load_studies().values()]
    if as_json:
        print_json([as_plain(one) for one in statuses])
        return
    rows = []
    for one in statuses:
        done, data = one.state == "done", one.study.dataset
        theirs = [claim for claim in one.claims if not claim.own]
        holding = sum(claim.verdict == HOLDS for claim in theirs)
        # What has not been run has neither come out nor failed to.
        printed = len(one.counted)
        found = tally(one.counted)
        close = f"{found.close['close']} of {printed}" if done else f"{printed} published"
        within = found.within if done else ""
        claims = f"{holding} of {len(theirs)}" if done else f"{len(theirs)} published"
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
                claims if theirs else "-",
                one.study.title,
            ]
        )
    print_table(["study", "kind", "state", "close", "within 90 %", "claims hold", "question"], rows)
    damaged = [one for one in statuses if one.state == "damaged"]
    if damaged:
        click.echo(f"{count(len(damaged), 'report')} not as written, and not counted:", err=True)
    for one in damaged:
        click.echo(f"  {one.study.name}: {one.reason}", err=True)


@click.command()
@click.argument("studies", nargs=-1, metavar="STUDY...")
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="All studies whose data are here.",
)
@click.option("--first-look", is_flag=True, help="A few flights of each study.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="In place of the study's own.")
@click.option(
    "--seeds",
    type=click.IntRange(1, 1_000_000),
    help="Over how many simulated flights.",
)
@click.option("--flight", type=FOLDER, help="In place of the study's own (one study).")
@jobs
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Seeds on a dask.distributed cluster.",
)
@shared.timeout
@shared.reports
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
    reports: Path,
) -> None:
    """Run studies; each leaves a report.

    The ledger shows them all. Studies kept apart, those whose data are not here, and those whose full report
    is there from the same code, are not in --all. --first-look makes reports from few flights; the full
    numbers take their place. A study that is named runs; the name of a case (schmidt) stands for all its
    studies.

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
    start_server()
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
        reports=reports,
        parallel=jobs,
        scheduler=scheduler,
        timeout_s=None if timeout is None else timeout * 60,
        console=terminal_console(),
    )
    click.echo(shown(reports / "index.html"))
    failed = [outcome.name for outcome in outcomes if outcome.state == "failed"]
    if failed:
        click.echo(f"{len(failed)} of {len(outcomes)} failed: {', '.join(failed)}.", err=True)
        sys.exit(1)


@click.command()
@click.argument("study")
@click.option(
    "--by",
    default="0.5,0.8,1.25,2",
    show_default=True,
    metavar="FACTORS",
    help="To multiply parameters by.",
)
@click.option("--seeds", type=click.IntRange(3, 10_000), default=20, show_default=True, help="Flights.")
@jobs
@shared.reports
def vary(study: str, by: str, seeds: int, jobs: int, reports: Path) -> None:
    """Show which verdicts of a STUDY hang on choices for its twin.

    Each group of chosen parameters is multiplied, the filters' tuning left alone; the table names the
    verdicts that turn. A moved flight shows its target in as many images as it does, at most in as many as
    are printed. What is computed is kept.

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
        reports=reports,
        parallel=jobs,
        tell=lambda line: console.print(line, highlight=False, soft_wrap=True),
    )
    rows = []
    for group, factor, turned, of, which in table.itertuples(index=False, name=None):
        share = "-" if math.isnan(turned) else f"{turned:.0f} of {of}"
        rows.append([str(group), f"{factor:g}", share, str(which)])
    print_table(["chosen parameters", "times", "turned", "which"], rows)
