"""The cases of the two theses, a file each: what is computed on a flight, and figures of it.

`protocol` says what a case offers, `rules` how units, claims and answers are read from ``data/studies``,
`page` what a page is made of, also of many simulated flights beside the print.

H is the doctoral thesis of H. H. Helgesen (NTNU, 2019), F the master's thesis of A. Flodell and
C. Christensson (Linköping University, 2016): see ``docs/references.md``.
"""

from pathlib import Path

from wildlab.paths import DATA

#: Where the rules of cases lie, a file for each.
FOLDERS = [DATA / "studies"]


def rule_files() -> dict[str, Path]:
    """The files of rules by case, which are the list of cases."""
    return {path.stem: path for folder in FOLDERS for path in sorted(folder.glob("*.toml"))}
