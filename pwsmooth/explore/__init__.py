"""`pwsmooth explore`: a page on which a switching system answers while a slider moves.

    subject.py   what is explored              describe.py  its controls and views, as data
    live.py      the orbit of a state          maps.py      orbit diagram, basins, section, growing
    frames.py    the wire format               worker.py    the two processes of a page
    server.py    files and one socket          code.py      the script and the figure of a state
    presets.py   states worth a look           static/      the page: one ES module, one style sheet

Chain: analysis, sweep, scenes -> **explore** -> cli.py. The server computes nothing; the page draws what the processes send.
"""

from __future__ import annotations

from .opening import explore

__all__ = ["explore"]
