"""The reference of all functions as HTML pages that open from disk: ``make docs``.

pdoc makes the pages; its templates are extended in ``docs/reference``. Nothing is fetched when they are read:
no script, font or picture comes from elsewhere.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
import shutil
import sys
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import pdoc

from wildlab.runner.catalogue import load_studies
from wildlab.runner.ledger import build_ledger

ROOT = Path(__file__).resolve().parents[1]
INTO = ROOT / "reports" / "reference"
#: What is called from a notebook or a script. Of the studies only what a study has to offer: the cases
#: themselves are read in their reports; `wildlab --help` tells the runner and the command line.
ROOMS = (
    *("api", "geometry", "flight", "navigation", "tracking", "simulation", "detection"),
    *("planning", "evaluation", "analysis"),
    *("reporting", "replay", "sharing"),
)


def modules() -> list[str]:
    """wildlab, its rooms and the files in them."""
    names = ["wildlab", "wildlab.errors", "wildlab.studies.protocol"]
    for room in ROOMS:
        package = importlib.import_module(f"wildlab.{room}")
        names.append(package.__name__)
        names += [module.name for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]
    return names


def build(into: Path, names: Sequence[str]) -> None:
    """Write the pages of modules into a folder, whole or not at all; what was there is replaced."""
    for name in names:
        module = importlib.import_module(name)
        for offered in getattr(module, "__all__", ()):
            getattr(module, offered)  # pdoc looks for names without asking for them
    # One module after the other: pdoc does not go below a package that says what it offers.
    pdoc.render.configure(
        docformat="numpy",
        template_directory=ROOT / "docs" / "reference",
        footer_text="wildlab",
        show_source=False,
        search=True,
    )
    into.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=into.parent, prefix=".reference.") as folder:
        pages = Path(folder) / "pages"
        pages.mkdir()
        with warnings.catch_warnings():
            # Fields of a NamedTuple keep their types as text, which pdoc looks up in the wrong module; it
            # then shows the text, which is what is wanted.
            warnings.filterwarnings("ignore", message="Error parsing type annotation ForwardRef")
            # It does go below one that does not say it.
            warnings.filterwarnings("ignore", message="The module specification .* adds a module")
            pdoc.pdoc(*names, output_directory=pages)
        for page in pages.rglob("*.html"):
            # Defaults that are paths: where this checkout lies is nobody's business. What models inherit from
            # pydantic links to its own manual, which is not here.
            text = page.read_text(encoding="utf-8").replace(f"{ROOT}/", "")
            page.write_text(re.sub(r'<a href="[./\w-]*\.md[^"]*">(.*?)</a>', r"\1", text), encoding="utf-8")
        pages.chmod(0o755)
        shutil.rmtree(into, ignore_errors=True)
        pages.rename(into)


if __name__ == "__main__":
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else INTO
    build(place, sys.argv[2:] or modules())
    if place == INTO:
        build_ledger(INTO.parent, load_studies())  # its front page links what is there
    print(place / "index.html")
