"""The page in a notebook, as an anywidget: the same module, the same two processes, frames over the kernel's comm.

A cell that runs delays pictures, as the comm is the kernel's; `Explorer.open()` gives a page beside it.
"""

from __future__ import annotations

import asyncio
import atexit
import functools
import threading
from typing import Any

from ..door import checks
from .bundle import module, style
from .processes import SHOWN, Workers

_WIDE = 1600  # px of the window, of which a notebook's cell is a part
_RENDER = """
function render({ model, el }) {
  const root = document.createElement("div");
  root.className = "explorer notebook";
  el.append(root);
  let hear = () => {};
  const heard = (message, buffers) => { if (buffers?.length) hear(buffers[0]); };
  model.on("msg:custom", heard);
  mount(root, {
    open(listen) { hear = listen; model.send({ kind: "open" }); },
    send(message) { model.send(message); },
    inside: true,
  });
  return () => model.off("msg:custom", heard);
}
export default { render };
"""


def widget_of(explorer: Any) -> Any:
    """The widget of an explorer; ImportError without anywidget."""
    return _class()(explorer)


@functools.cache
def _class() -> Any:
    checks.needs("anywidget", "anywidget>=0.9", "explore-notebook", "the widget")
    import anywidget  # an extra

    class Widget(anywidget.AnyWidget):
        """What a notebook shows; also an `Explorer`, whose names it has."""

        _esm = module() + _RENDER
        _css = style(wide=_WIDE)

        def __init__(self, explorer: Any) -> None:
            super().__init__()
            self.explorer = explorer
            self._workers: Workers | None = None
            self._loop = asyncio.get_event_loop()
            self.on_msg(self._heard)
            atexit.register(self.close_processes)

        def __getattr__(self, name: str) -> Any:
            if name in ("state", "solution", "code", "save", "open", "export"):
                return getattr(self.explorer, name)
            raise AttributeError(name)

        def _heard(self, _: Any, content: dict[str, Any], buffers: Any) -> None:
            if content.get("kind") == "open":  # shown, perhaps anew
                self.close_processes()
                self._workers = Workers(self.explorer.subject, self._frame)
                threading.Thread(target=self._watch, args=(self._workers,), daemon=True).start()
            elif self._workers is not None:
                self._workers.message(content)
                self.explorer._state.update({k: v for k, v in self._workers.state.items() if k in SHOWN})

        def _frame(self, frame: bytes) -> None:
            # A comm belongs to the kernel's thread.
            self._loop.call_soon_threadsafe(lambda: self.send({"kind": "frame"}, [frame]))

        def _watch(self, workers: Workers) -> None:
            while not workers.over:
                workers.watch()
                threading.Event().wait(0.25)

        def close_processes(self) -> None:
            """End the two processes."""
            if self._workers is not None:
                self._workers.end()
                self._workers = None

    return Widget
