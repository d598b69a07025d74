
const say = (text) => {
  const hidden = { canvas: true, narrow: true, wait: true, said: false, why: false };
  for (const id in hidden) document.getElementById(id).hidden = hidden[id];
  document.getElementById("why").textContent = text;
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
