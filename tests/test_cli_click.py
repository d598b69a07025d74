"""`wildlab click`: points marked on the page, what is saved, --take, and whom its server refuses."""

from __future__ import annotations

import contextlib
import http.client
import json
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.analysis.survey_twin import Survey, simulate
from tests.annotation import HOSTILE, ask, serving, write_images
from tests.commands import call
from wildlab.flight.readers import read_log
from wildlab.flight.readers.frames.image import read_image
from wildlab.flight.store import load_flight, save_flight
from wildlab.runner.annotation import (
    ClickServer,
    Session,
    open_session,
    read_points,
    table_of,
)


@pytest.fixture
def images(tmp_path: Path) -> Path:
    return write_images(tmp_path / "herd", "a2.png", "a10.png", HOSTILE)


@pytest.fixture
def serve() -> Iterator[Callable[[Session], ClickServer]]:
    with contextlib.ExitStack() as stack:
        yield lambda session: stack.enter_context(serving(session))


def open_page(browser: Any, address: str, faults: list[str]) -> Any:
    page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
    page.on("console", lambda message: faults.append(message.text))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("dialog", lambda dialog: faults.append(dialog.message))
    page.on("request", lambda one: None if one.url.startswith((address, "data:")) else faults.append(one.url))
    page.goto(address)
    page.wait_for_selector('#canvas[data-image]:not([data-image=""])')
    return page


def at_pixel(page: Any, u: float, v: float) -> tuple[float, float]:
    """Where a pixel's middle is on the screen."""
    canvas = page.locator("#canvas")
    scale, left, top = (float(canvas.get_attribute(f"data-{one}")) for one in ("scale", "left", "top"))
    box = canvas.bounding_box()
    return box["x"] + left + (u + 0.5) * scale, box["y"] + top + (v + 0.5) * scale


def wait_saved(page: Any) -> None:
    page.wait_for_selector('#saved:text-is("Saved")')


def test_clicks_keys_and_a_second_opening(browser, images, serve):
    faults: list[str] = []
    session = open_session(images)
    page = open_page(browser, serve(session).address, faults)
    page.keyboard.press("n")
    page.keyboard.type("=A1")
    page.keyboard.press("Enter")
    page.mouse.click(*at_pixel(page, 20.0, 10.0))
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowUp")
    page.mouse.click(*at_pixel(page, 40.0, 30.0))
    page.mouse.click(*at_pixel(page, 50.0, 40.0))
    page.keyboard.press("Delete")
    wait_saved(page)
    first, second = read_points(session.table)["a2.png"]
    assert (first.name, second.name) == ("=A1", "=A1")
    assert (*first[1:], *second[1:]) == pytest.approx((21, 9.9, 40, 30), abs=0.06)
    # The next image, by keys alone: nearer, a point in the middle of the view, another name.
    page.keyboard.press("Escape")
    page.keyboard.press("ArrowRight")
    page.wait_for_selector('#canvas[data-image="1"]')
    page.fill("#name", "B <b>bold</b>")
    page.keyboard.press("Enter")
    page.keyboard.press("+")
    page.keyboard.press("Enter")
    wait_saved(page)
    page.keyboard.press("PageDown")
    page.wait_for_selector('#canvas[data-image="2"]')
    assert page.locator("#image").inner_text() == HOSTILE
    page.keyboard.press("1")
    assert page.input_value("#name") == "=A1"
    page.keyboard.press("Enter")
    wait_saved(page)
    lines = session.table.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "image,name,u_px,v_px"
    assert [line.split(",")[0] for line in lines[1:]] == ["a2.png", "a2.png", "a10.png", HOSTILE]
    assert lines[1].startswith("a2.png,'=A1,")
    assert (page.locator("b b").count(), page.locator("img").count()) == (0, 0)
    # Opened again, all is there: the page and what other readers make of the file.
    again = open_session(images)
    assert again.points == session.points
    assert again.names == ["=A1", "B <b>bold</b>"]
    other = open_page(browser, serve(again).address, faults)
    other.wait_for_selector("#points li")
    assert other.locator("#points li").count() == 2
    part = read_log(session.table, session.table.read_bytes(), "clicks").parts["clicks"]
    assert part.columns["name"].tolist().count("=A1") == 3
    assert faults == []


def test_many_quick_clicks_are_all_saved(browser, images, serve):
    session = open_session(images)
    page = open_page(browser, serve(session).address, [])
    for number in range(12):
        page.mouse.click(*at_pixel(page, 4.0 * number + 3, 5.0))
    wait_saved(page)
    saved = read_points(session.table)["a2.png"]
    assert [round(one.u) for one in saved] == [4 * one + 3 for one in range(12)]


def test_finishing_ends_the_server(browser, images):
    server = ClickServer(open_session(images))
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    page = open_page(browser, server.address, [])
    page.mouse.click(*at_pixel(page, 3.0, 5.0))
    page.click("#finish")
    page.wait_for_selector("body:has-text('close this page')")
    thread.join(timeout=20)
    assert not thread.is_alive()
    server.server_close()


def test_an_image_that_cannot_be_read_says_so(browser, images, serve):
    (images / "a1.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    server = serve(open_session(images))
    page = browser.new_page()
    page.goto(server.address)
    page.wait_for_selector("#problem:not(:empty)")
    page.keyboard.press("Enter")  # nothing to mark
    assert page.locator("#points li").count() == 0


# -- the table


def test_a_table_that_cannot_be_read_is_not_written_over(images):
    table = table_of(images)
    table.write_text("image,name,u_px,v_px\na2.png,A,1,2\na2.png,B,x,2\n", encoding="utf-8")
    with pytest.raises(Exception, match="line 3"):
        open_session(images)


def test_where_images_are_looked_for(tmp_path):
    write_images(tmp_path / "a" / "images", "x.png")
    write_images(tmp_path / "elsewhere", "y.png", "z.png")
    assert [one.name for one in open_session(tmp_path / "a").images] == ["x.png"]
    named = open_session(tmp_path / "a", tmp_path / "elsewhere")
    assert [one.name for one in named.images] == ["y.png", "z.png"]


def test_images_of_a_flight_are_looked_for_in_the_folders_of_a_card(tmp_path):
    flight = simulate(Survey(images=4))
    save_flight(flight, tmp_path / "flight")
    names = [f"{one}.png" for one in flight.table("frames")["frame_id"]]
    write_images(tmp_path / "DCIM" / "100CANON", *names[:3], "other.png")
    write_images(tmp_path / "DCIM" / "101CANON", *names[3:])
    found = open_session(tmp_path / "flight", tmp_path / "DCIM").images
    assert sorted(one.name for one in found) == sorted(names)


# -- the command, as it is typed


def start(*arguments: Any) -> tuple[subprocess.Popen[str], str]:
    command = [sys.executable, "-m", "wildlab.cli", "click", *map(str, arguments)]
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        command,
        stdout=pipe,
        stderr=pipe,
        text=True,
        # In the background of a script Ctrl-C is ignored from birth; in a terminal it is not.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


def test_from_a_flight_to_its_detections(tmp_path):
    flight = simulate(Survey(images=4))
    frames = flight.table("frames")["frame_id"].tolist()
    targets = list(dict.fromkeys(flight.table("truth")["target_id"]))
    before = len(flight.table("detections"))
    folder = tmp_path / "flight"
    save_flight(flight, folder)
    write_images(folder / "images", *(f"{one}.png" for one in frames), "extra.png")
    process, address = start(folder)
    port, token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/", address).groups()  # type: ignore[union-attr]
    link = http.client.HTTPConnection("127.0.0.1", int(port), timeout=20)
    link.request("GET", f"/{token}/state")
    state = json.loads(link.getresponse().read())
    assert state["names"] == targets
    for image, name in ((f"{frames[1]}.png", targets[0]), ("extra.png", "")):
        number = state["images"].index(image)
        sent = {"image": number, "revision": 0, "points": [[name, 12.25, 7]]}
        link.request("POST", f"/{token}/clicks", json.dumps(sent), {"Content-Type": "application/json"})
        assert link.getresponse().read() == b'{"revision": 1}'
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0
    for _ in range(2):
        code, _, err = call("click", folder, "--take")
        assert code == 0 and "extra.png" in err
    # Loading holds every table against its checksum.
    found = load_flight(folder).table("detections")
    assert len(found) == before + 1
    own = found[found["source"] == "clicks"].iloc[0]
    assert (own["frame_id"], own["kind"], own["target_id"]) == (frames[1], "pixel", targets[0])
    assert (own["u_px"], own["v_px"]) == (12.25, 7.0)
    assert (folder / "images" / "extra.png").is_file()


def test_only_who_knows_the_address_is_answered(images, serve):
    session = open_session(images)
    server = serve(session)
    own = f"/{server.token}/"
    assert server.server_address[0] == "127.0.0.1"
    assert len(server.token) >= 32
    assert ask(server, "GET", own)[0] == 200
    good = f"127.0.0.1:{server.server_port}"
    for path, host in (
        ("/", good),
        ("/wrong/", good),
        (f"/{server.token[:-1]}/state", good),
        ("/state", good),
        (own, "evil.example"),
        (own, f"evil.example:{server.server_port}"),
        (own, "127.0.0.1:1"),
        (f"{own}state", ""),
        (f"{own}image/0", "[::1]"),
    ):
        status, body, _ = ask(server, "GET", path, Host=host)
        assert (status, b"refused" in body, b"a2.png" in body) == (403, True, False), (path, host)
    marks = {"image": 0, "revision": 0, "points": [["A", 1, 2]]}
    assert ask(server, "POST", "/wrong/clicks", marks)[0] == 403
    assert ask(server, "POST", f"{own}clicks", marks, Host="evil.example")[0] == 403
    assert ask(server, "POST", f"{own}clicks", marks, Origin="http://evil.example")[0] == 403
    assert ask(server, "POST", f"{own}clicks", marks, Origin="null")[0] == 403
    assert ask(server, "POST", f"{own}clicks", marks, Content_Type="text/plain")[0] == 415
    assert not session.table.exists()
    assert ask(server, "POST", f"{own}clicks", marks, Origin=f"http://{good}")[0] == 200
    assert session.table.exists()


@pytest.mark.parametrize(
    "path",
    [
        *("image/../../../../etc/passwd", "image/%2e%2e%2fsecret", "image/a2.png", "image/-1"),
        *("image/0/../1", "image/٣"),
    ],
)
def test_no_way_out_of_the_folder(images, serve, path):
    (images.parent / "secret").write_text("secret", encoding="utf-8")
    server = serve(open_session(images))
    link = socket.create_connection(("127.0.0.1", server.server_port), timeout=20)
    host = f"127.0.0.1:{server.server_port}"
    text = f"GET /{server.token}/{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
    link.sendall(text.encode())
    answer = b"".join(iter(lambda: link.recv(65536), b""))
    link.close()
    assert answer.startswith(b"HTTP/1.1 404")
    assert b"root:" not in answer
    assert b"secret" not in answer


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"image": 0, "revision": 0, "points": [["A", 1, float("inf")]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A\n,x", 1, 2]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A", True, 2e7]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A", 1, 2]] * 2001}, 400),
        ({"image": 0, "revision": 5, "points": []}, 409),
        ({"image": True, "revision": 0, "points": []}, 400),
        ([], 400),
    ],
)
def test_what_a_page_may_not_send(images, serve, body, status):
    session = open_session(images)
    server = serve(session)
    assert ask(server, "POST", f"/{server.token}/clicks", body)[0] == status
    assert not session.table.exists()


def test_a_page_may_not_send_without_end(images, serve):
    server = serve(open_session(images))
    link = socket.create_connection(("127.0.0.1", server.server_port), timeout=20)
    head = f"POST /{server.token}/clicks HTTP/1.1\r\nHost: localhost:{server.server_port}\r\n"
    link.sendall(f"{head}Content-Type: application/json\r\nContent-Length: 99999999999\r\n\r\n".encode())
    answer = b"".join(iter(lambda: link.recv(65536), b""))
    link.close()
    assert answer.startswith(b"HTTP/1.1 400")


def test_policy_forbids_everything_but_the_pages_own(images, serve):
    server = serve(open_session(images))
    _, body, headers = ask(server, "GET", f"/{server.token}/")
    policy = headers["content-security-policy"]
    nonce = re.search(r"script-src 'nonce-([\w-]+)'", policy)
    assert nonce is not None
    assert body.decode().count(f'nonce="{nonce[1]}"') == 2
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert (headers["cache-control"], headers["referrer-policy"]) == ("no-store", "no-referrer")
    assert nonce[1] not in ask(server, "GET", f"/{server.token}/")[2]["content-security-policy"]
    assert b"http" not in body.replace(b"charset", b"")


def test_images_of_16_bits_are_stretched_and_others_are_as_they_are(images, serve):
    server = serve(open_session(images))
    shown = [
        cv2.imdecode(np.frombuffer(ask(server, "GET", f"/{server.token}/image/{number}")[1], np.uint8), -1)
        for number in (0, 1)
    ]
    plain, dark = read_image(images / "a2.png").image, read_image(images / "a10.png").image
    assert (shown[0] == plain).all()
    assert shown[1].dtype == np.uint8
    assert (shown[1].min(), shown[1].max()) == (0, 255)
    order = np.argsort(dark, axis=None)
    assert (np.diff(shown[1].ravel()[order].astype(int)) >= 0).all()
