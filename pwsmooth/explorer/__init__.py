"""`pwsmooth explore`: a page on which a switching system answers while a slider moves.

    subject.py   what is explored              describe.py  its controls and views, as data
    live.py      the orbit of a state          maps.py      orbit diagram, basins, section, growing
    frames.py    the wire format               worker.py    the two processes of a page
    processes.py what starts and ends them     server.py    files and one socket
    widget.py    the page in a notebook        export.py    a file without Python
    code.py      script and figure of a state  presets.py   states worth a look
    opening.py   explore(), the command        static/      the page: one ES module, one style sheet

Chain: analysis, studies, scenes -> **explorer** -> cli.py. The server computes nothing; the page draws what it is sent.
"""

from __future__ import annotations

from .opening import explore

__all__ = ["explore"]
