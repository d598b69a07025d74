"""What every test shares: when slow tests run, where larger data lie, how hypothesis behaves, a browser."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from wildlab.runner.processes import ONE_THREAD

# Before numpy and OpenCV are imported: their threads take the cores of other test processes, and make small
# matrices slower, not faster.
os.environ.update(ONE_THREAD)
# No PDF of figures: a third of the time of a page.
os.environ.setdefault("WILDLAB_QUICK_FIGURES", "1")

import psutil
import pytest
from hypothesis import HealthCheck, settings

#: Set by nearly every CI service; "false", "0" and "" count as not set.
IN_CI = os.environ.get("CI", "").lower() not in ("", "0", "false")

# No deadline anywhere: the first call of a compiled function takes seconds, and a busy machine is no fault.
settings.register_profile("here", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("ci", parent=settings.get_profile("here"), derandomize=True, print_blob=True)
settings.load_profile("ci" if IN_CI else "here")


def pytest_configure() -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)


def pytest_keyboard_interrupt() -> None:
    """Told to end: what the tests have started ends as well, and no process waits for the end of its test."""
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            process.kill()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--run-slow", action="store_true", help="also run tests marked slow (so does CI=true)")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave slow tests out, unless CI, ``--run-slow``, ``-m`` or a test named by ``::`` asks for them; then
    files with slow tests come first, so that no process is left with a long one at the end. What needs a
    browser is slow."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker("slow")
    named = any("::" in argument for argument in config.args)
    if IN_CI or named or config.getoption("--run-slow") or config.getoption("markexpr"):
        last = {item.path: 0 for item in items} | {item.path: -1 for item in items if "slow" in item.keywords}
        items.sort(key=lambda item: last[item.path])
        return
    slow = [item for item in items if "slow" in item.keywords]
    if slow:
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if "slow" not in item.keywords]


#: Files whose tests share nothing and take long: each test goes to whichever process is free.
APART = ("tests/runner/test_studies.py",)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Over several processes (``-n``), the tests of a file stay in one, which makes their flights once."""
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):  # type: ignore[misc, unused-ignore]
        def _split_scope(self, nodeid: str) -> str:
            file: str = super()._split_scope(nodeid)
            return nodeid if file in APART else file

    config.option.loadscopereorder = False
    return ByFile(config, log)


def find_shared_data(*parts: str) -> Path | None:
    """The file or folder of that name among data too large for the repository, or None.

    Looked for in the folder that ``WILDLAB_TEST_DATA`` names, else in ``shared/data`` beside the checkout.
    """
    named = os.environ.get("WILDLAB_TEST_DATA")
    root = Path(named) if named else Path(__file__).resolve().parents[1].parent / "shared" / "data"
    path = root.joinpath(*parts)
    return path if path.exists() else None


@pytest.fixture(scope="session")
def shared_data() -> Callable[..., Path]:
    """``shared_data("georeferencing", "openathena")`` gives the path, or skips the test without it."""

    def find(*parts: str) -> Path:
        path = find_shared_data(*parts)
        if path is None:
            name = "/".join(parts)
            pytest.skip(f"needs the data set {name}: set WILDLAB_TEST_DATA to the folder that holds it")
        return path

    return find


def find_chromium() -> str | None:
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
    return os.environ.get("WILDLAB_CHROMIUM") or next(filter(None, map(shutil.which, names)), None)


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    program = find_chromium()
    if program is None:
        pytest.skip("needs Chromium: install it, or name one in WILDLAB_CHROMIUM")
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (the extra `dev`)")
    with playwright.sync_playwright() as play:
        started = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture
def browser(chromium: Any) -> Iterator[Any]:
    """Its pages are closed with the test: one that moves would go on moving, and slow all others."""
    yield chromium
    for context in chromium.contexts:
        context.close()


#: Both layouts and both schemes.
VIEWS = ((1200, "light"), (360, "dark"))


@pytest.fixture
def faults(browser: Any) -> Callable[[Path], list[str]]:
    """``faults(page.html)`` opens a page offline, wide and bright, narrow and dark, and lists its faults.

    With ``axe=False`` without the rules for readers with other eyes, hands and ears: for pages whose look is
    another program's.
    """

    def look(path: Path, axe: bool = True) -> list[str]:
        found = [] if path.stat().st_size <= 5_000_000 else ["larger than 5 MB"]
        for width, scheme in VIEWS:
            found += _faults_at(browser, path, width, scheme, axe)
        return found

    return look


def _faults_at(browser: Any, path: Path, width: int, scheme: str, axe: bool) -> list[str]:
    found: list[str] = []
    address = path.as_uri()
    context = browser.new_context(
        viewport={"width": width, "height": 844}, offline=True, color_scheme=scheme, bypass_csp=True
    )
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: found.append(f"console: {message.text}"))
    page.on("pageerror", lambda error: found.append(f"error: {error}"))
    page.on("dialog", lambda dialog: found.append(f"dialog: {dialog.message}"))
    page.goto(address)
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    found += [f"asks for {url[:80]}" for url in asked if url != address and not url.startswith("data:")]
    wide = page.evaluate("document.documentElement.scrollWidth")
    if wide > width:
        found.append(f"{wide} px wide on a screen of {width}")
    if page.evaluate("[...document.images].some(one => !one.alt.trim() || !one.naturalWidth)"):
        found.append("a picture without alt text, or broken")
    if page.evaluate("document.documentElement.lang") != "en":
        found.append("no language")
    # A tutorial begins with words; who opens a report or the front page wants to see.
    invites = path.name in ("report.html", "index.html")
    if width == 360 and invites and (top := page.evaluate(_FIRST_PICTURE)) > 2 * 844:
        found.append(f"the first picture is {top:.0f} px down on a phone")
    found += [
        f"a link to {to[:60]}, which is missing where the page is mailed alone" for to in _dead(page, path)
    ]
    found += _axe(page) if axe else []
    context.close()
    return found


_FIRST_PICTURE = """(() => { const one = document.querySelector('figure img');
  return one ? one.getBoundingClientRect().top + window.scrollY : 0 })()"""
_LINKS = "[...document.querySelectorAll('[href], [src]')].map(one => one.getAttribute('href') ?? one.src)"


def _dead(page: Any, path: Path) -> list[str]:
    """Links that lead neither into the page, nor to a file within it, nor to the web. A page that is no
    report is not mailed alone: it may lead to what lies beside it."""
    folder = None if path.name == "report.html" else path.parent
    return [
        to
        for to in page.evaluate(_LINKS)
        if not to.startswith(("data:", "https://"))
        and not (to.startswith("#") and page.evaluate("id => !!document.getElementById(id)", to[1:]))
        and not (folder is not None and (folder / unquote(to.partition("#")[0])).is_file())
    ]


def _axe(page: Any) -> list[str]:
    """What axe finds against the rules for readers with other eyes, hands and ears."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe (the extra `dev`)")
    found = axe.Axe().run(page).response["violations"]
    return [f"axe: {one['id']}: {one['nodes'][0]['html'][:160]} ({len(one['nodes'])})" for one in found]
