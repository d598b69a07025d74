"""What tests of `wildlab click` share: made-up images, a server that ends, a link to it."""

from __future__ import annotations

import contextlib
import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wildlab.runner.annotation import ClickServer, Session

HOSTILE = "z<img src=x onerror=alert(1)>.png"


def write_images(folder: Path, *names: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(3)
    for number, name in enumerate(names):
        image = random.integers(60, 90, (48, 64)).astype(np.uint8)
        # One of 16 bits, dark but for a few counts.
        whole = image.astype(np.uint16) + 21000 if number == 1 else image
        done, packed = cv2.imencode(".png", whole)
        assert done
        (folder / name).write_bytes(packed.tobytes())
    return folder


@contextlib.contextmanager
def serving(session: Session) -> Iterator[ClickServer]:
    """A server that answers until the block ends."""
    server = ClickServer(session)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()


def ask(
    server: ClickServer, method: str, path: str, body: Any = None, **headers: str
) -> tuple[int, bytes, dict[str, str]]:
    link = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=20)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    if body is not None:
        named.setdefault("Content-Type", "application/json")
    link.request(method, path, None if body is None else json.dumps(body), named)
    answer = link.getresponse()
    return answer.status, answer.read(), {name.lower(): value for name, value in answer.getheaders()}
