"""`make docs`: the reference opens from disk, fetches nothing, and has every name that is offered."""

from __future__ import annotations

import html
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest
from bs4 import BeautifulSoup

from tests.rooms import DOCUMENTED, offered
from wildlab import paths

ELSEWHERE = re.compile(r"^\s*(?:https?:)?//")


#: What stands for the modules that no room offers: one with models, whose manual is not here, and another.
ALSO = ("wildlab.flight.manifest", "wildlab.analysis.tracks.tracker", "wildlab.errors")


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    into = tmp_path_factory.mktemp("docs") / "reference"
    command = [sys.executable, "tools/reference.py", str(into), *DOCUMENTED, *ALSO]
    done = subprocess.run(command, cwd=paths.ROOT, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    assert "warn" not in done.stderr.lower(), done.stderr
    return into


#: A tag that fetches what it names, a style that does, and a module that a script imports.
FETCHES = re.compile(
    r"""<[a-z]+\s[^>]*?\bsrc(?:set)?\s*=\s*["']?\s*(?:https?:)?//[^>]*"""
    r"""|<link\b[^>]*?\bhref\s*=\s*["']?\s*(?:https?:)?//[^>]*""",
    re.IGNORECASE,
)
STYLES = re.compile(r"@import[^;]*|url\(\s*['\"]?(?:https?:)?//[^)]*")
MODULES = re.compile(r"import\b[^\n;]*https?://[^\n;]*")


def requests(page: str) -> list[str]:
    """What a page would fetch from elsewhere when it is opened."""
    inside = {
        tag: " ".join(re.findall(rf"<{tag}\b[^>]*>(.*?)</{tag}>", page, re.DOTALL))
        for tag in ("style", "script")
    }
    shown = re.sub(r"(<(script|style)\b[^>]*>).*?</\2>", r"\1", page, flags=re.DOTALL)
    return [*FETCHES.findall(shown), *STYLES.findall(inside["style"]), *MODULES.findall(inside["script"])]


@pytest.mark.slow
def test_the_reference_is_whole_and_offline(reference):
    pages = sorted(reference.rglob("*.html"))
    assert reference / "index.html" in pages and len(pages) > len(DOCUMENTED)
    for path in pages:
        page = path.read_text(encoding="utf-8")
        assert requests(page) == [], path.name
        assert str(paths.ROOT) not in page, path.name
        shown = re.sub(r"<script\b.*?</script>", "", page, flags=re.DOTALL)
        for link in re.findall(r'<a\b[^>]*?\shref="([^"#]*)', shown):
            target = html.unescape(link)
            assert not target or ELSEWHERE.match(target) or (path.parent / target).is_file(), (
                path.name,
                target,
            )


@pytest.mark.slow
@pytest.mark.parametrize("room", DOCUMENTED)
def test_every_name_that_is_offered_has_its_place(reference, room):
    page = (reference / f"{room.replace('.', '/')}.html").read_text(encoding="utf-8")
    places = {tag["id"]: tag for tag in BeautifulSoup(page, "html.parser").find_all(id=True)}
    for name, thing in offered(room):
        assert name in places
        described = inspect.isclass(thing) or inspect.isroutine(thing)  # an alias repeats what it stands for
        if described and "\nParameters\n-----" in (thing.__doc__ or ""):
            assert places[name].find(re.compile("^h[1-6]$"), string="Parameters") is not None, name


def test_the_first_page_opens_in_a_browser(reference, faults):
    index = (reference / "index.html").read_text(encoding="utf-8")
    assert all(f">{room}</a>" in index for room in DOCUMENTED if room.count(".") < 2)
    for page in ("index.html", "wildlab.html", "wildlab/errors.html", "wildlab/analysis/tracks/tracker.html"):
        # The look of these pages is pdoc's.
        assert faults(reference / page, axe=False) == [], page
