"""The page that plays a flight: what it may do stands in it; in a browser it moves and asks nobody."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from wildlab.errors import WildlabError
from wildlab.flight.store import save_flight
from wildlab.replay.page import Viewer, page, parts_of, read_viewer
from wildlab.runner.replay import PAGE, RECORDING, replay
from wildlab.simulation.twins import simulate_twin

MADE_UP = Viewer("0", "var wasm_bindgen = '</script><script>alert(1)//<!--';", b"\0asm and more")


def test_the_page_holds_all_and_allows_only_its_own_scripts():
    text = page(b"\0recording\xff", MADE_UP, "</title><script>x", b"narrow")
    parts = {"viewer": MADE_UP.wasm, "recording": b"\0recording\xff", "narrow-layout": b"narrow"}
    assert dict(parts_of(text)) == parts
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy is not None
    rules = dict(part.strip().split(" ", 1) for part in policy[1].split(";"))
    assert rules["default-src"] == "'none'" and "connect-src" not in rules
    assert "unsafe-inline" not in policy[1] and "http" not in policy[1] and "*" not in policy[1]
    scripts = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    hashes = [base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts]
    assert len(scripts) == 3
    assert rules["script-src"].split() == [*(f"'sha256-{one}'" for one in hashes), "'wasm-unsafe-eval'"]
    assert "<script>x" not in text and "alert(1)" in scripts[1]
    assert not re.search(r"""(?:src|href)=(?!["']data:)""", text)


def test_the_program_listens_to_this_machine_alone_and_counts_nobody(tmp_path, monkeypatch):
    import rerun_cli

    seen = tmp_path / "seen"
    program = tmp_path / "rerun"
    program.write_text(
        f'#!/bin/sh\n(echo "$@"; env; cat "$HOME/.config/rerun/analytics.json") > {seen}\nexit 1\n'
    )
    program.chmod(0o755)
    monkeypatch.setattr(rerun_cli, "__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")
    monkeypatch.setenv("HOME", str(tmp_path / "of the user"))
    with pytest.raises(WildlabError):
        read_viewer()
    said = seen.read_text()
    assert "--bind 127.0.0.1" in said and '"analytics_enabled": false' in said
    assert "FORCE_RERUN_ANALYTICS" not in said and "of the user" not in said and "\nCI=1\n" in said


@pytest.fixture(scope="module")
def graphics(launch: Callable[..., Any]) -> Iterator[Any]:
    """A browser that draws three dimensions without a graphics card."""
    chromium = launch("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
    yield chromium
    chromium.close()


@pytest.mark.slow
def test_a_browser_without_a_network_plays_it(graphics, tmp_path):
    save_flight(simulate_twin("large-ship", 1), tmp_path / "flight")
    written, _ = replay(tmp_path / "flight", into=tmp_path / "out", html=True)
    assert [one.name for one in written] == [RECORDING, PAGE]
    assert written[1].stat().st_size < 24_000_000
    context = graphics.new_context(viewport={"width": 1000, "height": 700}, offline=True)
    opened = context.new_page()
    asked: list[str] = []
    broken: list[str] = []
    opened.on("request", lambda request: asked.append(request.url))
    opened.on("pageerror", lambda error: broken.append(str(error)))
    opened.goto(written[1].as_uri())
    opened.wait_for_selector("html[data-shown=yes]", state="attached", timeout=180_000)
    opened.wait_for_timeout(8000)
    # The time line stops under the pointer: a third along it, and two thirds.
    pictures = []
    for x in (450, 700):
        opened.mouse.click(x, 688)
        opened.wait_for_timeout(4000)
        # The map alone: the time line itself would differ in any case.
        pictures.append(_pixels(opened.screenshot(clip={"x": 5, "y": 40, "width": 580, "height": 420})))
    context.close()
    assert asked == [written[1].as_uri()] and broken == []
    first, second = pictures
    assert first.std() > 5, "nothing is drawn"
    assert (abs(first - second).max(axis=2) > 24).sum() > 100, "nothing moves"


def _pixels(png: bytes) -> Any:
    import cv2
    import numpy as np

    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).astype(int)
