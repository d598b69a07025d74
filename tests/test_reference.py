"""`make docs`: the reference opens from disk, fetches nothing, and has every name that is offered."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bs4 import BeautifulSoup

from tests.rooms import DOCUMENTED, offered
from wildlab import paths

ELSEWHERE = re.compile(r"^\s*(?:https?:)?//")


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    into = tmp_path_factory.mktemp("docs") / "reference"
    command = [sys.executable, "tools/reference.py", str(into)]
    done = subprocess.run(command, cwd=paths.ROOT, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    assert "warn" not in done.stderr.lower(), done.stderr
    return into


def requests(page: str) -> list[str]:
    """What a page would fetch from elsewhere when it is opened."""
    soup = BeautifulSoup(page, "html.parser")
    found = [
        str(tag)
        for tag in soup.find_all(True)
        for name in ("src", "srcset")
        if ELSEWHERE.match(tag.get(name, ""))
    ]
    found += [str(tag) for tag in soup.find_all("link") if ELSEWHERE.match(tag.get("href", ""))]
    styles = [style.get_text() for style in soup.find_all("style")]
    found += [
        one
        for style in styles
        for one in re.findall(r"@import[^;]*|url\(\s*['\"]?(?:https?:)?//[^)]*", style)
    ]
    # Modules that a script imports from a server.
    return found + re.findall(
        r"import\b[^\n;]*https?://[^\n;]*", " ".join(s.get_text() for s in soup.find_all("script"))
    )


@pytest.mark.slow
def test_the_reference_is_whole_and_offline(reference: Path) -> None:
    pages = sorted(reference.rglob("*.html"))
    assert reference / "index.html" in pages and len(pages) > 60
    for path in pages:
        page = path.read_text(encoding="utf-8")
        assert requests(page) == [], path.name
        assert str(paths.ROOT) not in page, path.name
        for link in BeautifulSoup(page, "html.parser").find_all("a", href=True):
            target = str(link["href"]).partition("#")[0]
            assert not target or ELSEWHERE.match(target) or (path.parent / target).is_file(), (
                path.name,
                target,
            )


@pytest.mark.slow
@pytest.mark.parametrize("room", DOCUMENTED)
def test_every_name_that_is_offered_has_its_place(reference: Path, room: str) -> None:
    page = (reference / f"{room.replace('.', '/')}.html").read_text(encoding="utf-8")
    soup = BeautifulSoup(page, "html.parser")
    for name, thing in offered(room):
        place = soup.find(id=name)
        assert place is not None, name
        described = inspect.isclass(thing) or inspect.isroutine(thing)  # an alias repeats what it stands for
        if described and "\nParameters\n-----" in (thing.__doc__ or ""):
            assert place.find(re.compile("^h[1-6]$"), string="Parameters") is not None, name


@pytest.mark.slow
def test_the_first_page_opens_in_a_browser(reference: Path, faults: Callable[..., list[str]]) -> None:
    index = (reference / "index.html").read_text(encoding="utf-8")
    assert all(f">{room}</a>" in index for room in DOCUMENTED if room.count(".") < 2)
    for page in ("index.html", "wildlab.html", "wildlab/flight.html", "wildlab/pipeline/track.html"):
        # The look of these pages is pdoc's.
        assert faults(reference / page, axe=False) == [], page


def test_a_request_is_found() -> None:
    assert (
        len(
            requests(
                '<script src="https://x/y.js"></script><link href="//x/y.css"><style>@import "a";</style>'
            )
        )
        == 3
    )
    assert (
        requests('<a href="https://x">x</a><img src="data:image/svg+xml,%3Csvg xmlns=http://www.w3.org">')
        == []
    )
