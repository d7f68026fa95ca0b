// The page of the server: the token and the state stand in the fragment, which browsers send to nobody.
import { mount } from "./explorer.js";

const ended = "The server has ended. The state stays in this page's address: start pwsmooth explore again.";
const given = new URLSearchParams(location.hash.slice(1)), state = (given.get("s") || "").slice(0, 12000);
if (given.get("t")) sessionStorage.setItem("token", given.get("t"));
let socket;
globalThis.explorer = mount(document.getElementById("explorer"), {
  open(hear, lost) {
    socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify({ token: sessionStorage.getItem("token") || "", state }));
    socket.onmessage = (e) => hear(e.data);
    socket.onclose = (e) => lost(e.reason ? `${e.reason}.` : ended);
  },
  send(message) {
    if (socket.readyState === 1) socket.send(JSON.stringify(message));
  },
  keep: (state) => history.replaceState(null, "", `#s=${state}`),
});
