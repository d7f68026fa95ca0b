"""How a run ended: the one list of outcomes, which every kernel returns and every Solution carries."""

from enum import IntEnum

__all__ = ["Outcome"]


class Outcome(IntEnum):
    """How a solve ended: the kernels' integer, with a `text` that says what to try next.

    Codes >= 0 are successes: the run did what was asked. A failure keeps the solution up to where it happened.

    Attributes
    ----------
    {members}

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> x = sp.Symbol("x", real=True)
    >>> blow_up = solve(System({x: x**2}), (0, 2), {x: 1})
    >>> blow_up.outcome.name, blow_up.success
    ('STEP_UNDERFLOW', False)
    """

    FINISHED = 0
    TERMINATED = 1
    AMBIGUITY = -1
    NOT_FINITE = -2
    STEP_UNDERFLOW = -3
    TOO_MANY_STEPS = -4
    EVENTS_ACCUMULATE = -5
    CHATTERING = -6
    EVENT_LOOP = -7
    NO_ROOT = -8
    SINGULAR = -9
    LAYER_UNSETTLED = -11
    DETERMINACY_LOST = -12
    OUT_OF_MEMORY = -13
    TIME_LIMIT = -14
    SINGULAR_POINT = -15
    IRREVERSIBLE = -16
    INCONSISTENT_CONTACT = -17
    JAM = -18
    BEHIND_CONTACT = -19

    @property
    def text(self) -> str:
        """What happened, and what to try."""
        return _TEXTS[self]

    @property
    def success(self) -> bool:
        """Whether the run did what was asked."""
        return self >= 0

    def __str__(self) -> str:
        return f"{self.name.lower().replace('_', ' ')}: {self.text}"


_TEXTS = {
    Outcome.FINISHED: "The end of `t_span` was reached.",
    Outcome.TERMINATED: "A terminal event stopped the run.",
    Outcome.AMBIGUITY: "The solution is not unique from here (`strict=True` stops there): see the solution's "
    "`ambiguities` for the continuations; `strict=False` follows the recorded one.",
    Outcome.NOT_FINITE: "The right-hand side became nan or infinite: look at the last state for a pole, a "
    "negative base of a power, or a missing branch.",
    Outcome.STEP_UNDERFLOW: "The step fell below the spacing of numbers at this time. Where a state or its rate has "
    "become huge, the motion has a singularity, past which no option leads; elsewhere the tolerance cannot be met: "
    "take a larger `rtol` or `atol`, or another `method`.",
    Outcome.TOO_MANY_STEPS: "The bound on steps was reached: raise `max_steps`, or shorten `t_span`.",
    Outcome.EVENTS_ACCUMULATE: "An event resets the state so that it fires again ever sooner, and no event says what "
    "holds from the limit time on: write a contact as `Unilateral`, or let a terminal event stop the run.",
    Outcome.CHATTERING: "Switchings accumulate and their limit time did not converge, or they go on for ever while the "
    "motion stays within `atol`: check the restitution and the surfaces that switch, add an event that ends the "
    "chattering, or take a smoothed view.",
    Outcome.EVENT_LOOP: "Events at one instant keep firing each other: let the `when` of each "
    "`Event` exclude the others after the update.",
    Outcome.NO_ROOT: "No attracting root of the layer was found and no direction leads out of it: the layer "
    "system may be unbounded; check the sign of the hidden term. Of a system with an `Algebraic`: its equation has no "
    "root here, or has lost the one that was followed.",
    Outcome.SINGULAR: "The equations of the sliding, closed or algebraic multipliers are singular: two of them "
    "may constrain the same motion; or more than 128 contacts or frictions between elements of a family hold, whose "
    "forces are not solved for together: take a spring with a gap.",
    Outcome.INCONSISTENT_CONTACT: "No reaction or impulse keeps the bodies of a rigid contact apart, as its friction "
    "pushes them together (Painleve's paradox, inconsistent): in nature a tangential impact stops the slip, of which "
    "rigid laws say nothing; take a compliant contact (`pwsmooth.laws.contact`), or less friction.",
    Outcome.JAM: "The reaction of a slipping contact grows beyond all bounds, as its friction comes to push as hard as "
    "it holds (Painleve's paradox, dynamic jam): a compliant contact (`pwsmooth.laws.contact`) decides what follows.",
    Outcome.BEHIND_CONTACT: "The gap of a rigid contact is negative at the start, after an update, or where the gap "
    "itself has jumped, and no motion begins behind a stop: give states with gaps of 0 or more, turn the sign of the "
    "gap, or let a table rise in a finite time.",
    Outcome.IRREVERSIBLE: "Backward in time the past is not unique from here: forward the motion has come to a "
    "stick or to rest, an event has set a memory, or an impact returned nothing. Start before it and go forward.",
    Outcome.LAYER_UNSETTLED: "The layer system neither settled nor left within its bound: a hidden "
    "oscillation, perhaps a slow one; try another `eps_ratio` of `system.layered(...)`, or the "
    "smoothed view.",
    Outcome.DETERMINACY_LOST: "The solution has reached a two-fold, from which many solutions leave and none "
    "is distinguished: see the solution's `ambiguities`; a smoothed view decides for one.",
    Outcome.OUT_OF_MEMORY: "The steps that are kept no longer fit into memory: ask for the times you need by `t_eval` "
    "without `dense_output`, go in several spans, or see why the steps are so short.",
    Outcome.TIME_LIMIT: "The time that the call was given is over: raise `max_seconds`, or go on from the last state.",
    Outcome.SINGULAR_POINT: "A function of the field has come to a point where it is infinite, has no limit or ceases "
    "to be defined; the last event names it and says what to do.",
}
if Outcome.__doc__:
    Outcome.__doc__ = Outcome.__doc__.replace(
        "{members}", "\n    ".join(f"{outcome.name}\n        {text}" for outcome, text in _TEXTS.items())
    )
