
const doors = ["XMLHttpRequest", "WebSocket", "EventSource", "WebTransport", "Worker", "SharedWorker"];
window.fetch = () => Promise.reject(new TypeError("no network"));
for (const name of doors)
  window[name] = class { constructor() { throw new TypeError("no network"); } };
navigator.sendBeacon = () => false;
for (const name of ["debug", "info", "log"]) console[name] = () => {};
window.open = () => null;
document.getElementById("wait").hidden = false;
