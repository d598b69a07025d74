"""The trials of all flights as a table, for the notebook that shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from wildlab.errors import RunFailed
from wildlab.paths import REPORTS
from wildlab.runner.processes.worker_pool import WorkerPool
from wildlab.runner.seeds import (
    SeedWork,
    again_words,
    failed_seeds,
    faults,
    make_work,
    read_seed,
    set_aside,
    take_stock,
)


def trials_table(
    case: str,
    seeds: int,
    *,
    study: str,
    seed: int,
    drawn: Mapping[tuple[str, str], float],
    out: str = "",
    **parameters: Any,
) -> pd.DataFrame:
    """The numbers of all flights: columns (subject, name), one row for each seed, the flight drawn first.

    `wildlab run` has computed them before the notebook starts. In a notebook opened by hand, those that are
    not there yet, and those whose kept numbers are damaged, are computed now, in a process beside the kernel,
    and kept.

    Parameters
    ----------
    case
        Whose trial it is (``case`` in ``studies.toml``).
    seeds
        How many flights, the one drawn included.
    seed, drawn
        Seed of the flight that the figures show, and what the notebook has computed on it.
    out
        The notebook's parameter: the report's folder, beside which the store is.
    parameters
        The trial's.

    Raises
    ------
    WildlabError
        If a parameter is missing, a seed fails, or its numbers have other names than those of the other seeds
        even when they are computed again; it names the seed.
    """
    reports = Path(out).parent if out else REPORTS
    work = make_work(reports, study, case, seed, seeds, parameters)
    stock, fresh = take_stock(work), set[int]()
    set_aside(work, stock.damaged)
    for words in again_words(stock):
        print(f"{study}: {words}")
    while missing := [one for one in take_stock(work, fresh).missing if one not in fresh]:
        _compute(work, missing)
        fresh |= set(missing)
    if wrong := faults(work, fresh):
        raise RunFailed(failed_seeds(wrong), "mend that; the other seeds are kept")
    rows = {one: read_seed(work, one) for one in work.seeds}
    unread = [one for one, values in rows.items() if values is None]
    if unread:
        raise RunFailed(f"the numbers of seed {unread[0]} have gone while they were read", "run it again")
    tables = [dict(drawn), *(split_keys(values) for values in rows.values() if values is not None)]
    return pd.DataFrame(tables, index=pd.Index([seed, *work.seeds], name="seed"))


def split_keys(values: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """Keys "subject/name" as (subject, name)."""
    result = {}
    for key, value in values.items():
        subject, _, name = key.partition("/")
        result[subject, name] = value
    return result


def _compute(work: SeedWork, missing: Sequence[int]) -> None:
    failures: list[tuple[int, str]] = []
    with WorkerPool() as pool:
        for done, one in enumerate(missing):
            print(f"\r{work.study}: {done} of {len(missing)} seeds", end="", flush=True)
            pool.submit(work, one)
            while not (results := pool.collect(wait_s=0.25)):
                pass
            failures += [(result.seed, result.failure.reason) for result in results if result.failure]
    print(f"\r{work.study}: {len(missing) - len(failures)} of {len(missing)} seeds", flush=True)
    if failures:
        raise RunFailed(failed_seeds(failures), "mend that; the seeds that are finished are kept")
