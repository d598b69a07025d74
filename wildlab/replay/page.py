"""A recording and the viewer for it in one HTML file that opens from disk and asks nobody for anything."""

from __future__ import annotations

import base64
import gzip
import hashlib
from collections.abc import Iterator

from wildlab.replay.viewer import Viewer
from wildlab.reporting.text import escape

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
