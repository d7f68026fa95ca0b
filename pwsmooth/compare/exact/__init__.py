"""Problems with exact answers."""

from ... import on_first_use

_HOME = dict.fromkeys(("Check", "ExactProblem", "Verdict"), "contract") | {
    "problems": "verifying",
    "verify": "verifying",
}
__getattr__, __dir__ = on_first_use(__name__, _HOME)
