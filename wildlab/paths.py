"""Where the parts of the project that are not Python live.

In a checkout, notebooks, data and reports stand beside the package, and ``make`` installs it in place. A
wheel carries notebooks, data and lock inside the package (``setup.py`` puts them there); reports then go to
the current folder, public data to the user's cache, and nothing to where packages are installed.
"""

from pathlib import Path

#: The folder of the code.
PACKAGE = Path(__file__).resolve().parent


def find_checkout(package: Path) -> Path | None:
    """The checkout that a package stands in; None where it is installed."""
    beside = package.parent
    checkout = (beside / "pyproject.toml").is_file() and (beside / "notebooks" / "studies.toml").is_file()
    return beside if checkout else None


#: The checkout that wildlab runs from; None where it was installed from a wheel.
ROOT = find_checkout(PACKAGE)
#: What holds notebooks, data and lock; only read.
RESOURCES = PACKAGE / "resources" if ROOT is None else ROOT
NOTEBOOKS = RESOURCES / "notebooks"
DATA = RESOURCES / "data"
LOCK = RESOURCES / "environment.lock"
REPORTS = Path("reports") if ROOT is None else ROOT / "reports"


def fetched() -> Path:
    """Where public data sets go: ``data/fetched`` of a checkout, otherwise the user's cache."""
    if ROOT is not None:
        return DATA / "fetched"
    import platformdirs  # few commands need it

    return platformdirs.user_cache_path("wildlab") / "fetched"
