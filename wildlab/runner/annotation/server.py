"""The server behind the page: on this machine alone, for whoever knows its address.

It listens on 127.0.0.1 and answers only where the address holds the random token and the browser means this
server by its Host; so neither another machine nor another page in the same browser gets anything. Images are
asked for by number, never by name.
"""

from __future__ import annotations

import hmac
import json
import re
import secrets
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import read_regular
from wildlab.flight.readers.frames.image import MOST_BYTES, decode
from wildlab.paths import DATA
from wildlab.replay.images import stretch_contrast
from wildlab.runner.annotation.session import Session, check_points

#: Bytes that a page may send at once, and how long it may take for it, s.
MOST_SENT, PATIENCE_S = 1_000_000, 60
#: Pictures that are decoded at once: each may be large.
AT_ONCE = 2
#: Colour images with more pixels are sent as JPEG, which takes a twentieth of the time.
MOST_EXACT = 4_000_000
QUALITY = 95
_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "X-Frame-Options": "DENY",
}


class ClickServer(ThreadingHTTPServer):
    """Serves one session.

    Parameters
    ----------
    session
        What is marked.
    port
        On 127.0.0.1; 0 for any that is free.
    """

    daemon_threads = True

    def __init__(self, session: Session, port: int = 0) -> None:
        self.session = session
        self.token = secrets.token_urlsafe(24)
        self.decoding = threading.BoundedSemaphore(AT_ONCE)
        super().__init__(("127.0.0.1", port), _Handler)
        self.hosts = frozenset(f"{name}:{self.server_port}" for name in ("127.0.0.1", "localhost"))

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://127.0.0.1:{self.server_port}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Browsers break off as they like; whatever else happens is the terminal's."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


def open_server(session: Session, port: int = 0) -> ClickServer:
    """A server for a session.

    Parameters
    ----------
    session
        What is marked.
    port
        On 127.0.0.1; 0 for any that is free.

    Returns
    -------
    ClickServer

    Raises
    ------
    WildlabError
        Where the port is taken.
    """
    try:
        return ClickServer(session, port)
    except OSError as error:
        raise WildlabError(
            f"the port {port} cannot be listened on ({error.strerror})", "choose another", field="--port"
        ) from None


class _Handler(BaseHTTPRequestHandler):
    server: ClickServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "wildlab", ""
    timeout = PATIENCE_S

    def do_GET(self) -> None:
        place = self._place()
        if place is None:
            return
        number = re.fullmatch(r"image/(\d{1,9})", place)
        if place == "":
            nonce = secrets.token_urlsafe(18)
            self._answer(200, "text/html; charset=utf-8", make_page(nonce).encode(), _policy(nonce))
        elif place == "state":
            self._json(200, self.server.session.state())
        elif number and int(number[1]) < len(self.server.session.images):
            with self.server.decoding:
                found = picture_of(self.server.session.images[int(number[1])])
            if isinstance(found, str):
                self._text(422, found)
            else:
                self._answer(200, found.kind, found.data)
        else:
            self._text(404, "there is nothing here")

    def do_POST(self) -> None:
        place = self._place()
        if place is None:
            return
        origin = self.headers.get("Origin")
        if origin is not None and origin.removeprefix("http://") not in self.server.hosts:
            self._text(403, "this page is not of this server")
        elif self.headers.get_content_type() != "application/json":
            self._text(415, "JSON is wanted")
        elif place == "clicks":
            self._mark(self._sent())
        elif place == "finish":
            self._json(200, {})
            threading.Thread(target=self.server.shutdown, daemon=True).start()
        else:
            self._text(404, "there is nothing here")

    def _mark(self, sent: Any) -> None:
        if not isinstance(sent, dict):
            self._text(400, "no object of JSON, or too much of it")
            return
        session = self.server.session
        image, revision = sent.get("image"), sent.get("revision")
        if type(image) is not int or type(revision) is not int or not 0 <= image < len(session.images):
            self._text(400, "there is no such image")
            return
        points = check_points(sent.get("points"))
        if isinstance(points, str):
            self._text(400, points)
            return
        try:
            now = session.mark(image, points, revision)
        except WildlabError as error:
            self._text(500, error.problem)
            return
        if now is None:
            self._text(409, "another window marked this image meanwhile: load the page again")
        else:
            self._json(200, {"revision": now})

    def _place(self) -> str | None:
        """What is asked for below the token; None where it is refused, and that was said."""
        host = self.headers.get("Host", "")
        _, token, place = [*self.path.split("?", 1)[0].split("/", 2), "", ""][:3]
        known = hmac.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode())
        if host not in self.server.hosts or not known:
            self._text(403, "refused: open the address that the terminal shows")
            return None
        return place

    def _sent(self) -> Any:
        length = self.headers.get("Content-Length", "")
        if not length.isascii() or not length.isdecimal() or int(length) > MOST_SENT:
            self.close_connection = True
            return None
        try:
            return json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            return None

    def _json(self, status: int, content: Any) -> None:
        self._answer(status, "application/json", json.dumps(content).encode())

    def _text(self, status: int, said: str) -> None:
        # Whatever was sent and not read would be taken for the next request.
        self.close_connection = True
        self._answer(status, "text/plain; charset=utf-8", said.encode("utf-8", "replace"))

    def _answer(self, status: int, kind: str, body: bytes, policy: str = "default-src 'none'") -> None:
        self.send_response(status)
        headers = {"Content-Type": kind, "Content-Length": str(len(body)), "Content-Security-Policy": policy}
        for name, value in {**headers, **_HEADERS}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the terminal shows the address and the next command."""


def make_page(nonce: str) -> str:
    """The page, whose own script and style alone may run.

    Parameters
    ----------
    nonce
        A number used once, of letters that stand in an attribute.

    Returns
    -------
    str
        HTML; names of images and points come to it as data, and are shown as text.
    """
    page, style, script = (
        (DATA / "pages" / f"click.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js")
    )
    parts = {"{nonce}": nonce, "{style}": style, "{script}": script}
    return re.sub(r"\{(nonce|style|script)\}", lambda match: parts[match[0]], page)


def _policy(nonce: str) -> str:
    return (
        f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


class Picture(NamedTuple):
    """Bytes of a picture and their kind, as browsers call it."""

    data: bytes
    kind: str


def picture_of(path: Path) -> Picture | str:
    """An image file as a picture with the pixels that it has, or a sentence that says why not.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Picture or str
        Pixels stand as they are stored: what a file says of turning it is not obeyed.
    """
    try:
        found = decode(read_regular(path, MOST_BYTES))
    except FileNotFoundError:
        found = "there is no such file any more"
    except WildlabError as error:
        found = f"it {error.problem}"
    if isinstance(found, str):
        return f"This image cannot be shown: {found}."
    image, unit, _ = found
    if unit not in ("grey", "colour"):
        image = stretch_contrast(image)
    if image.ndim == 3:
        image = np.ascontiguousarray(image[..., ::-1])
    if image.ndim == 3 and image.shape[0] * image.shape[1] > MOST_EXACT:
        done, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        kind = "image/jpeg"
    else:
        done, packed = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        kind = "image/png"
    return Picture(packed.tobytes(), kind) if done else "This image cannot be shown."
