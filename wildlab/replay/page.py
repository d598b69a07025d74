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

from wildlab.errors import WildlabError
from wildlab.reporting.text import escape

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

STYLE = """
html,body{margin:0;height:100%;overflow:hidden}
body{background:#f6f8f9;color:#18222d;font:16px/1.5 system-ui,sans-serif}
canvas{position:absolute;inset:0;width:100%;height:100%}
#said{position:absolute;inset:0;display:grid;place-content:center;padding:1.5rem;text-align:center}
#said p{max-width:34rem;margin:.4rem auto}
#narrow{display:none;box-sizing:border-box;height:8rem;margin:0;padding:.5rem .8rem;overflow:auto;
  font-size:14px}
@media(max-width:44rem){#narrow{display:block}canvas{top:8rem;height:calc(100% - 8rem)}}
[hidden]{display:none!important}
"""

#: Before the viewer: whatever it would ask the network for it is refused at once, and by the policy above.
#: It also logs each shader that it compiles in tens of thousands of lines, which takes longer than all else.
BEFORE = """
const doors = ["XMLHttpRequest", "WebSocket", "EventSource", "WebTransport", "Worker", "SharedWorker"];
window.fetch = () => Promise.reject(new TypeError("no network"));
for (const name of doors)
  window[name] = class { constructor() { throw new TypeError("no network"); } };
navigator.sendBeacon = () => false;
for (const name of ["debug", "info", "log"]) console[name] = () => {};
window.open = () => null;
document.getElementById("wait").hidden = false;
"""

#: What stands in for it, where it cannot be shown.
INSTEAD = "The moving picture in the flight's report shows the same path in any browser."

AFTER = (
    """
const say = (text) => {
  const hidden = { canvas: true, narrow: true, wait: true, said: false, why: false };
  for (const id in hidden) document.getElementById(id).hidden = hidden[id];
  document.getElementById("why").textContent = text + " INSTEAD";
};
async function unpack(id) {
  const text = atob(document.getElementById(id).textContent.trim());
  const packed = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
async function show() {
  if (typeof WebAssembly !== "object" || typeof DecompressionStream !== "function") {
    return say("This browser is too old to show it: Chrome 91, Firefox 113, Safari 16.4 and newer ones can.");
  }
  if (!document.createElement("canvas").getContext("webgl2"))
    return say("This browser cannot draw it here: it has no WebGL 2, or that is switched off.");
  await wasm_bindgen({ module_or_path: await unpack("viewer") });
  const handle = new wasm_bindgen.WebHandle({
    url: [], manifest_url: null, render_backend: "webgl", video_decoder: null, hide_welcome_screen: true,
    panel_state_overrides: { top: "Hidden", blueprint: "Hidden", selection: "Hidden" },
    enable_history: false, notebook: true, persist: false, theme: "light",
  });
  await handle.start(document.getElementById("canvas"));
  handle.open_channel("replay", "replay");
  handle.send_rrd_to_channel("replay", await unpack("recording"));
  if (matchMedia("(max-width:44rem)").matches)
    handle.send_rrd_to_channel("replay", await unpack("narrow-layout"));
  handle.close_channel("replay");
  document.getElementById("said").hidden = true;
  for (const id of ["canvas", "narrow"]) document.getElementById(id).hidden = false;
  document.documentElement.dataset.shown = "yes";
  const watch = setInterval(() => { if (handle.has_panicked()) {
    clearInterval(watch);
    say("The viewer broke off. Open this file again.");
  } }, 1000);
}
show().catch((error) => say("This browser cannot show it (" + error + ")."));
"""
).replace("INSTEAD", INSTEAD)


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
    scripts = [BEFORE, _inert(viewer.script), AFTER]
    policy = POLICY.format(hashes=" ".join(f"'sha256-{_hash(one)}'" for one in scripts), style=_hash(STYLE))
    title = escape(f"Replay of {name}")
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width,initial-scale=1">',
        '<meta name="referrer" content="no-referrer"><link rel="icon" href="data:,">',
        f"<title>{title}</title><style>{STYLE}</style></head><body>",
        f'<p id="narrow" hidden><b>{title}</b>, played over and over. Drag the map to turn it, and '
        "spread two fingers to come closer. Held sideways, the screen has a time line. Less, and easier to "
        "read: the moving picture in the flight's report.</p>",
        f'<div id="said" role="status"><p><b>{title}</b></p>'
        '<p id="wait" hidden>It takes some seconds to open.</p><p id="why" hidden></p>'
        "<noscript><p>This file plays a flight with a script of its own, and scripts are off here. "
        f"{INSTEAD}</p></noscript></div>",
        f'<canvas id="canvas" hidden tabindex="0" aria-label="{title}, an interactive view"></canvas>',
        f"<script>{scripts[0]}</script>",
        f'<script type="application/octet-stream" id="viewer">{_packed(viewer.wasm)}</script>',
        f'<script type="application/octet-stream" id="recording">{_packed(recording)}</script>',
        f'<script type="application/octet-stream" id="narrow-layout">{_packed(narrow)}</script>',
        *(f"<script>{one}</script>" for one in scripts[1:]),
        "</body></html>\n",
    ]
    return "\n".join(parts)


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
