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
from typing import Any, NoReturn

import click

from wildlab import __version__
from wildlab.commands import calibration, evaluation, flights, shared, sharing, studies
from wildlab.commands.detect import detect
from wildlab.commands.plan import plan
from wildlab.commands.shared import FOLDER, count, print_json, print_table, sentence, shown, stopped
from wildlab.errors import WildlabError, system_error


class Commands(click.Group):
    """Commands in the order in which they are needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


@click.group(cls=Commands, context_settings=SETTINGS)
@click.version_option(__version__, prog_name="wildlab")
def wildlab() -> None:
    """Analyse UAV surveillance flights, and regenerate the figures of the two theses.

    \b
    Examples:
      wildlab run --all             every study whose data are here
      wildlab evaluate FLIGHT       how accurate is a flight of your own
      wildlab compare FLIGHT...     several of them on one page
    """


for _command in (
    studies.list_,
    studies.run,
    studies.vary,
    evaluation.evaluate,
    evaluation.compare,
    flights.import_,
    flights.click_,
    evaluation.georeference,
    evaluation.track,
    evaluation.replay,
    calibration.camera,
    detect,
    calibration.calibrate,
    calibration.clock,
    flights.terrain,
    plan,
    sharing.share,
    sharing.verify,
):
    wildlab.add_command(_command)


@wildlab.command()
@click.argument("flight", type=FOLDER)
@shared.as_json
@click.option("--accept", is_flag=True, help="Its files were changed on purpose: new checksums first.")
def check(flight: Path, as_json: bool, accept: bool) -> None:
    """Say whether FLIGHT is usable, and for what.

    Exits with 2 where there is a problem.

    \b
    Examples:
      wildlab check flights/tuesday
      wildlab check --accept flights/tuesday    after a change that was meant
    """
    from wildlab.flight.checks.check import check_flight, usable_for
    from wildlab.flight.store import accept_changes, load_flight

    if accept:
        changed = accept_changes(flight)
        said = f"accepted as they are: {', '.join(changed)}" if changed else "nothing was changed"
        click.echo(sentence(said), err=True)
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
        # What a purpose takes may be there and contradict itself.
        yes = "once what is above is mended" if problems else "yes"
        for use in uses:
            click.echo(f"{use.purpose}: {yes if use.usable else 'no'}, {stopped(use.why)}")
    if problems:
        sys.exit(2)


@wildlab.command()
@click.argument("dataset", required=False)
@shared.as_json
def fetch(dataset: str | None, as_json: bool) -> None:
    """Get a public data set, or list them.

    It is checked by its SHA-256. WILDLAB_DATA_MIRROR=FOLDER takes the files from a folder in place of the
    network.

    \b
    Example:
      wildlab fetch openathena
    """
    from wildlab.flight import catalog

    if dataset is not None:

        def tell(file: str, done: int, count: int) -> None:
            click.echo(f"getting {file} ({done + 1} of {count})", err=True)

        for path in catalog.fetch(dataset, progress=tell):
            click.echo(shown(path))
        return
    rows: list[dict[str, Any]] = [
        {
            "dataset": name,
            "fetched": bool(catalog.is_fetched(name)),
            "title": entry.title,
            "licence": entry.licence,
            "source": entry.source,
        }
        for name, entry in catalog.read_catalog().items()
    ]
    if as_json:
        print_json(rows)
    else:
        print_table(
            ["dataset", "here", "licence", "what"],
            [[r["dataset"], "yes" if r["fetched"] else "no", r["licence"], r["title"]] for r in rows],
        )


@wildlab.command()
@click.argument("twin")
@shared.out(FOLDER, "Folder of the flight to make.", required=True)
@shared.seed
@shared.overwrite
def simulate(twin: str, out: Path, seed: int, overwrite: bool) -> None:
    """Simulate a twin as a flight folder. TWIN is one that comes with wildlab, or a parameter file.

    \b
    Example:
      wildlab simulate static-antenna --out flights/antenna --seed 7
    """
    from wildlab.flight.store import save_flight
    from wildlab.simulation.twins import simulate_twin

    save_flight(simulate_twin(twin, seed), out, overwrite=overwrite)
    click.echo(shown(out))


@wildlab.command()
@shared.as_json
def doctor(as_json: bool) -> None:
    """Say what is wrong with this installation, and the fix.

    Exits with 2 where something is.

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


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Entry point of ``wildlab``: turns every error into a sentence and an exit code."""
    # Read when numpy is imported, which no command has done yet: on small matrices threads only wait.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
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
        if isinstance(error, OSError) and error.errno and error.filename:
            click.echo(f"wildlab: {system_error(error)}", err=True)
            sys.exit(2)
        click.echo(
            f"wildlab: Something unexpected happened ({type(error).__name__}: {error}). "
            "Run it again with WILDLAB_DEBUG=1 to see where, and report that.",
            err=True,
        )
        sys.exit(1)


if __name__ == "__main__":
    main()
