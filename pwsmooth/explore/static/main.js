// The page of the server: the token and the state stand in the fragment, which browsers send to nobody.
import { mount, socketTransport } from "./explorer.js";

const given = new URLSearchParams(location.hash.slice(1));
if (given.get("t")) sessionStorage.setItem("token", given.get("t"));
const transport = socketTransport(sessionStorage.getItem("token") || "");
transport.keep = (state) => history.replaceState(null, "", `#s=${state}`);
globalThis.explorer = mount(document.getElementById("explorer"), transport, given.get("s") || "");
