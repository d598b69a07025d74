"""The command line. Each command is a call of one function in a room; rooms are imported when they are
needed.

Exit codes: 0 done, 1 the run failed, 2 wrong use or unusable input, 130 broken off with Ctrl-C.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click

from wildlab import __version__
from wildlab.errors import WildlabError
from wildlab.terminal import count, print_json, print_table, sentence, shown, stopped

if TYPE_CHECKING:
    from rich.console import Console

FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)


class Commands(click.Group):
    """Commands in the order in which they are needed, and a hint where a name is misspelt."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        from difflib import get_close_matches

        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            near = get_close_matches(args[0], self.commands, n=1)
            if not near or "did you mean" in error.message.lower():
                raise
            raise click.UsageError(f"{error.message} Did you mean {near[0]!r}?", ctx) from error


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="wildlab")
def wildlab() -> None:
    """Analyse UAV surveillance flights, and regenerate the figures of the two theses.

    \b
    Examples:
      wildlab run --all             every study whose data are here
      wildlab evaluate FLIGHT       how accurate is a flight of your own
    """


@wildlab.command("list")
@click.option("--out", type=FOLDER, help="Where the reports are.  [default: reports]")
@click.option("--json", "as_json", is_flag=True, help="As JSON, with every published number and ours.")
def list_(out: Path | None, as_json: bool) -> None:
    """The studies, and where each stands: published numbers, and how many agree.

    \b
    Example:
      wildlab list
    """
    from wildlab.evaluation.printed import AGREES
    from wildlab.evaluation.shares import HOLDS, MOSTLY
    from wildlab.flight.catalog import is_fetched
    from wildlab.runner.catalogue import load_studies
    from wildlab.runner.record.status import as_plain, study_status

    statuses = [study_status(study, _reports(out)) for study in load_studies().values()]
    if as_json:
        print_json([as_plain(one) for one in statuses])
        return
    rows = []
    for one in statuses:
        done, data = one.state == "done", one.study.dataset
        holding = sum(claim.verdict in (HOLDS, MOSTLY) for claim in one.claims)
        # What has not been run has neither come out nor failed to.
        count = len(one.counted)
        numbers = f"{one.count(AGREES)} of {count}" if done else f"{count} printed"
        claims = f"{holding} of {len(one.claims)}" if done else f"{len(one.claims)} printed"
        first = f"; first: wildlab fetch {data}" if data and not done and not is_fetched(data) else ""
        state = f"{one.state}{first}"
        rows.append(
            [
                one.study.name,
                one.study.kind,
                state,
                numbers if one.numbers else "-",
                claims if one.claims else "-",
                one.study.title,
            ]
        )
    print_table(["study", "kind", "state", "numbers agree", "claims hold", "question"], rows)


@wildlab.command()
@click.argument("studies", nargs=-1, metavar="STUDY...")
@click.option(
    "--all", "everything", is_flag=True, help="All studies; those whose data are not here are skipped."
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
    type=click.FloatRange(0, min_open=True),
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
        reports=_reports(out),
        parallel=jobs,
        scheduler=scheduler,
        timeout_s=None if timeout is None else timeout * 60,
        console=_console(),
    )
    click.echo(shown(_reports(out) / "index.html"))
    failed = [outcome.name for outcome in outcomes if outcome.state == "failed"]
    if failed:
        click.echo(f"{len(failed)} of {len(outcomes)} failed: {', '.join(failed)}.", err=True)
        sys.exit(1)


@wildlab.command()
@click.argument("flight", type=FOLDER)
@click.option("--source", help="Which poses to judge, where the flight has several (its nav/NAME.parquet).")
@click.option("--out", type=FOLDER, help="Where the report goes.  [default: reports]")
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), help="Minutes it may take.  [default: 30]"
)
def evaluate(flight: Path, source: str | None, out: Path | None, timeout: float | None) -> None:
    """What is a flight worth? FLIGHT is a folder made by `wildlab import`.

    One report on the accuracy of its georeferencing, and one on its navigation, as far as the data go.

    \b
    Examples:
      wildlab evaluate flights/tuesday
      wildlab evaluate flights/antenna --source autopilot
    """
    from wildlab.runner.evaluate import evaluate_flight

    outcomes = evaluate_flight(
        flight,
        source=source,
        reports=_reports(out),
        timeout_s=None if timeout is None else timeout * 60,
        console=_console(),
    )
    for outcome in outcomes:
        if outcome.folder is not None:
            click.echo(shown(outcome.folder / "report.html"))
    if any(outcome.state == "failed" for outcome in outcomes):
        sys.exit(1)


@wildlab.command()
@click.argument("flight", type=FOLDER)
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def check(flight: Path, as_json: bool) -> None:
    """Is a flight usable, and for what? Exits with 2 where there is a problem.

    \b
    Example:
      wildlab check flights/tuesday
    """
    from wildlab.flight.checks.check import check_flight, usable_for
    from wildlab.flight.store import load_flight

    loaded = load_flight(flight)
    findings, uses = check_flight(loaded), usable_for(loaded)
    problems = sum(finding.level == "problem" for finding in findings)
    if as_json:
        names = ("level", "table", "field", "sentence", "fix")
        print_json(
            {
                "findings": [{name: getattr(finding, name) for name in names} for finding in findings],
                "usable_for": [{"purpose": u.purpose, "usable": u.usable, "why": u.why} for u in uses],
            }
        )
    else:
        for finding in findings:
            click.echo(f"{finding.level}: {stopped(finding.sentence)} {sentence(finding.fix)}".rstrip())
        warnings = sum(finding.level == "warning" for finding in findings)
        click.echo(sentence(f"{count(problems, 'problem')}, {count(warnings, 'warning')}"))
        for use in uses:
            click.echo(f"{use.purpose}: {'yes' if use.usable else 'no'}, {stopped(use.why)}")
    if problems:
        sys.exit(2)


@wildlab.command("import")
@click.argument("recipe", type=FILE)
@click.option("--source", type=FOLDER, help="Folder of the raw files.  [default: the recipe's]")
@click.option("--into", type=FOLDER, required=True, help="Folder of the flight to make.")
@click.option("--overwrite", is_flag=True, help="Replace the flight that is there.")
def import_(recipe: Path, source: Path | None, into: Path, overwrite: bool) -> None:
    """Make a flight folder from raw logs, as RECIPE says. The raw files are not changed.

    How to write one is in data/recipes/README.md; `wildlab doctor` says where that data folder is.

    \b
    Example:
      wildlab import recipe.toml --source logs --into flights/mine
    """
    from wildlab.flight.recipe.importing import import_flight

    import_flight(recipe, source, into, overwrite=overwrite)
    click.echo(shown(into))
    click.echo(f'Next: wildlab check "{shown(into)}"', err=True)


@wildlab.command()
@click.argument("dataset", required=False)
@click.option("--json", "as_json", is_flag=True, help="Without DATASET: the list as JSON.")
def fetch(dataset: str | None, as_json: bool) -> None:
    """Get a public data set, checked by its SHA-256; without DATASET, list what there is.

    WILDLAB_DATA_MIRROR=FOLDER takes the files from a folder in place of the network.

    \b
    Example:
      wildlab fetch openathena
    """
    from wildlab.flight import catalog

    if dataset is not None:
        for path in catalog.fetch(dataset, progress=_tell_download):
            click.echo(shown(path))
        return
    rows = _datasets(catalog)
    if as_json:
        print_json(rows)
    else:
        print_table(
            ["dataset", "here", "licence", "what"],
            [[r["dataset"], "yes" if r["fetched"] else "no", r["licence"], r["title"]] for r in rows],
        )


@wildlab.command()
@click.argument("twin")
@click.option("--into", type=FOLDER, required=True, help="Folder of the flight to make.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=1, show_default=True)
@click.option("--overwrite", is_flag=True, help="Replace the flight that is there.")
def simulate(twin: str, into: Path, seed: int, overwrite: bool) -> None:
    """Simulate a twin as a flight folder. TWIN is one that comes with wildlab, or a parameter file.

    \b
    Example:
      wildlab simulate static-antenna --into flights/antenna --seed 7
    """
    from wildlab.flight.store import save_flight
    from wildlab.simulation.twins import simulate_twin

    save_flight(simulate_twin(twin, seed), into, overwrite=overwrite)
    click.echo(shown(into))


@wildlab.command()
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def doctor(as_json: bool) -> None:
    """What is wrong with this installation, and the fix. Exits with 2 where something is.

    \b
    Example:
      wildlab doctor
    """
    from wildlab.doctor import examine

    findings = examine()
    if as_json:
        print_json([{"ok": f.ok, "name": f.name, "found": f.found, "fix": f.fix} for f in findings])
    else:
        for finding in findings:
            mark = "ok   " if finding.ok else "WRONG"
            fix = f"\n       {finding.fix}" if finding.fix else ""
            click.echo(f"{mark}  {finding.name}: {finding.found}{fix}")
    if not all(finding.ok for finding in findings):
        sys.exit(2)


# -- what the commands share
# ------------------------------------------------------------------------------------


def _datasets(catalog: Any) -> list[dict[str, Any]]:
    return [
        {
            "dataset": name,
            "fetched": bool(catalog.is_fetched(name)),
            "title": entry.title,
            "licence": entry.licence,
            "source": entry.source,
        }
        for name, entry in catalog.read_catalog().items()
    ]


def _tell_download(file: str, done: int, count: int) -> None:
    click.echo(f"getting {file} ({done + 1} of {count})", err=True)


def _reports(out: Path | None) -> Path:
    from wildlab.paths import REPORTS

    return REPORTS if out is None else out


def _console() -> Console:
    from rich.console import Console

    # Progress goes to standard error: standard output is the path of the result.
    return Console(stderr=True)


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Entry point of ``wildlab``: turns every error into a sentence and an exit code."""
    # Being asked to end is the same as Ctrl-C: children are ended, nothing half-written stays.
    signal.signal(signal.SIGTERM, _terminate)
    try:
        result = wildlab.main(args=arguments, prog_name="wildlab", standalone_mode=False)
        sys.exit(result if isinstance(result, int) else 0)
    except click.exceptions.Exit as error:
        sys.exit(error.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except (click.Abort, KeyboardInterrupt):
        click.echo("Stopped. What was finished is kept; what was under way is as it was before.", err=True)
        sys.exit(130)
    except BrokenPipeError:
        # Whoever read our output has seen enough; Python would complain again when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except WildlabError as error:
        click.echo(f"wildlab: {error}", err=True)
        sys.exit(error.exit_code)
    except Exception as error:
        if os.environ.get("WILDLAB_DEBUG") == "1":
            raise
        click.echo(
            f"wildlab: Something unexpected happened ({type(error).__name__}: {error}). "
            "Run it again with WILDLAB_DEBUG=1 to see where, and report that.",
            err=True,
        )
        sys.exit(1)


if __name__ == "__main__":
    main()
