"""The server of `wildlab click`: who is refused, and what may not be sent; what it shows."""

from __future__ import annotations

import contextlib
import re
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.clicking import HOSTILE, ask, serving, write_images
from wildlab.flight.readers.frames.image import read_image
from wildlab.runner.clicking.pictures import Picture, picture_of
from wildlab.runner.clicking.server import ClickServer
from wildlab.runner.clicking.session import Session, open_session


@pytest.fixture
def images(tmp_path: Path) -> Path:
    return write_images(tmp_path / "herd", "a2.png", "a10.png", HOSTILE)


@pytest.fixture
def serve() -> Iterator[Callable[[Session], ClickServer]]:
    with contextlib.ExitStack() as stack:
        yield lambda session: stack.enter_context(serving(session))


def test_only_who_knows_the_address_is_answered(images: Path, serve: Any) -> None:
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
        *("image/../../../../etc/passwd", "image/%2e%2e%2fsecret", "image/a2.png", "image/-1", "image/99"),
        *("../state/..", "image/0/../1", "static/x", "image//etc/passwd", "image/٣"),
    ],
)
def test_no_way_out_of_the_folder(images: Path, serve: Any, path: str) -> None:
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
        ({"image": 0, "revision": 0, "points": [["A", 1]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A" * 61, 1, 2]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A\n,x", 1, 2]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A", True, 2e7]]}, 400),
        ({"image": 0, "revision": 0, "points": [["A", 1, 2]] * 2001}, 400),
        ({"image": 0, "revision": 5, "points": []}, 409),
        ({"image": 3, "revision": 0, "points": []}, 400),
        ({"image": "0", "revision": 0, "points": []}, 400),
        ({"image": True, "revision": 0, "points": []}, 400),
        ([], 400),
    ],
)
def test_what_a_page_may_not_send(images: Path, serve: Any, body: Any, status: int) -> None:
    session = open_session(images)
    server = serve(session)
    assert ask(server, "POST", f"/{server.token}/clicks", body)[0] == status
    assert not session.table.exists()


def test_a_page_may_not_send_without_end(images: Path, serve: Any) -> None:
    server = serve(open_session(images))
    link = socket.create_connection(("127.0.0.1", server.server_port), timeout=20)
    head = f"POST /{server.token}/clicks HTTP/1.1\r\nHost: localhost:{server.server_port}\r\n"
    link.sendall(f"{head}Content-Type: application/json\r\nContent-Length: 99999999999\r\n\r\n".encode())
    answer = b"".join(iter(lambda: link.recv(65536), b""))
    link.close()
    assert answer.startswith(b"HTTP/1.1 400")


def test_policy_forbids_everything_but_the_pages_own(images: Path, serve: Any) -> None:
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


def test_images_of_16_bits_are_stretched_and_others_are_as_they_are(images: Path, serve: Any) -> None:
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


def test_a_large_colour_image_keeps_its_pixels(tmp_path: Path) -> None:
    rows, columns = np.indices((2100, 2000))
    image = np.stack([rows % 256, columns // 8 % 256, (rows + columns) // 16 % 256], axis=-1).astype(np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 2)
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", image)[1].tobytes())
    found = picture_of(tmp_path / "a.png")
    assert isinstance(found, Picture)
    assert found.kind == "image/jpeg"
    shown = cv2.imdecode(np.frombuffer(found.data, np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == image.shape
    assert np.abs(shown.astype(int) - image).mean() < 4
    assert isinstance(picture_of(tmp_path / "b.png"), str)
