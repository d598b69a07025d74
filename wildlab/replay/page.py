"""A replay as one HTML file: the recording and rerun's viewer, out of the installed rerun-sdk."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple
from urllib.error import URLError
from urllib.request import ProxyHandler, build_opener

from markupsafe import Markup

from wildlab.errors import WildlabError
from wildlab.reporting.text import TEMPLATES, render

#: How long the program may take to begin to answer, s, and how much it may answer with, bytes.
PATIENCE_S, MOST_BYTES = 60.0, 200_000_000
SCRIPT, WASM = "re_viewer.js", "re_viewer_bg.wasm"


class Viewer(NamedTuple):
    """The viewer of one version of rerun: its script as text and its WebAssembly as bytes."""

    version: str
    script: str
    wasm: bytes


def read_viewer() -> Viewer:
    """The viewer that belongs to the installed rerun-sdk.

    Returns
    -------
    Viewer

    Raises
    ------
    WildlabError
        Where rerun-sdk is missing, or the one installed has no viewer for browsers in it.
    """
    program, found = _program()
    with tempfile.TemporaryDirectory(prefix="wildlab-viewer.") as home:
        web, data = _free_ports(2)
        process = subprocess.Popen(  # noqa: S603 - the program of a package, with fixed arguments
            [
                str(program), "--serve-web", "--bind", "127.0.0.1",
                "--web-viewer-port", str(web), "--port", str(data),
            ],
            env=_quiet(Path(home)),
            cwd=home,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            script = _get(process, web, SCRIPT)
            wasm = _get(process, web, WASM)
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    if wasm[:4] != b"\0asm" or b"wasm_bindgen" not in script:
        raise _none("what it hands out is not a viewer")
    return Viewer(found, script.decode("utf-8"), wasm)


def _program() -> tuple[Path, str]:
    try:
        import rerun_cli

        found = version("rerun-sdk")
    except (ImportError, PackageNotFoundError):
        raise WildlabError(
            "rerun-sdk is not installed, and the viewer is a part of it",
            "install what environment.lock names (make environment), or: pip install 'rerun-sdk==0.41.*'",
        ) from None
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    program = Path(str(rerun_cli.__file__)).with_name(name)
    if not program.is_file():
        raise _none("its program is missing")
    return program, found


def _none(why: str) -> WildlabError:
    return WildlabError(
        f"the rerun-sdk that is installed has no viewer for browsers: {why}",
        "install the wheel from PyPI (pip install --force-reinstall 'rerun-sdk==0.41.*'), which has it; "
        "replay.rrd, without --html, opens with: rerun replay.rrd",
    )


def _quiet(home: Path) -> dict[str, str]:
    """An environment in which rerun neither counts nor finds anything of its user."""
    settings = home / ".config" / "rerun" / "analytics.json"
    settings.parent.mkdir(parents=True)
    kept = home / "data"
    content = {
        "analytics_enabled": False, "analytics_id": "", "metadata": {},
        "config_file_path": str(settings), "data_dir_path": str(kept),
    }  # fmt: skip
    settings.write_text(json.dumps(content), encoding="utf-8")
    own = {"HOME": str(home), "XDG_CONFIG_HOME": str(home / ".config"), "XDG_DATA_HOME": str(kept)}
    # Where `CI` is set rerun does not count either, wherever this system would keep its settings.
    own |= {"APPDATA": str(home), "LOCALAPPDATA": str(home), "CI": "1", "TELEMETRY_ENABLED": "false"}
    return {name: value for name, value in os.environ.items() if "RERUN" not in name} | own


def _free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()


def _get(process: subprocess.Popen[bytes], port: int, name: str) -> bytes:
    opener = build_opener(ProxyHandler({}))  # this machine is not asked for by way of another
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            with opener.open(f"http://127.0.0.1:{port}/{name}", timeout=PATIENCE_S) as answer:
                return bytes(answer.read(MOST_BYTES))
        except (URLError, OSError) as error:
            if process.poll() is not None:
                raise _none(f"its program ended with {process.returncode}") from None
            if time.monotonic() > until:
                raise _none(f"it did not answer within {PATIENCE_S:g} s ({error})") from None
            time.sleep(0.1)


#: What the browser may do: run the scripts with these hashes, and WebAssembly; show what is in the file.
POLICY = (
    "default-src 'none'; script-src {hashes} 'wasm-unsafe-eval'; style-src 'sha256-{style}'; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'"
)


def page(recording: bytes, viewer: Viewer, name: str, narrow: bytes) -> str:
    """One HTML file with all of it inside.

    Parameters
    ----------
    recording
        The bytes of an ``.rrd``.
    viewer
        Of the version that wrote it.
    name
        Of the flight.
    narrow
        A layout that narrow screens get, as ``.rbl``.

    Returns
    -------
    str
    """
    # Before the viewer: whatever it would ask the network for is refused at once, and by the policy as well.
    before, after, style = (_read(name) for name in ("replay-before.js", "replay-after.js", "replay.css"))
    scripts = [before, _inert(viewer.script), after]
    hashes = " ".join(f"'sha256-{_hash(one)}'" for one in scripts)
    packed = {"viewer": viewer.wasm, "recording": recording, "narrow-layout": narrow}
    return (
        render(
            "replay",
            policy=POLICY.format(hashes=hashes, style=_hash(style)),
            title=f"Replay of {name}",
            style=Markup(style),  # noqa: S704 - ours
            scripts=list(map(Markup, scripts)),
            packed={name: _packed(data) for name, data in packed.items()},
        )
        + "\n"
    )


def _read(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _inert(script: str) -> str:
    """A script that does not end the element it stands in."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--").replace("\r", "")


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _packed(data: bytes) -> str:
    # Without the time at which it was packed.
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode()


def parts_of(text: str) -> Iterator[tuple[str, bytes]]:
    """What is packed into a page, by the id of its element.

    Parameters
    ----------
    text
        From `page`.

    Returns
    -------
    Iterator of (str, bytes)
    """
    for one in text.split('<script type="application/octet-stream" id="')[1:]:
        name, _, rest = one.partition('">')
        yield name, gzip.decompress(base64.b64decode(rest.partition("</script>")[0]))
