"""What `pwsmooth verify` prints."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from .contract import ExactProblem, Verdict
from .verifying import problems, verify


def list_problems() -> bool:
    """Prints every problem with its statement and the source of its answer."""
    table = Table("problem", "statement", "source of the answer", box=None, pad_edge=False)
    for problem in problems().values():
        table.add_row(problem.name, problem.statement, problem.source)
    Console().print(table, highlight=False)
    return True


def run(names: Sequence[str], of: Sequence[ExactProblem] | None = None) -> bool:
    """Solves the problems, prints each as it is done, and says whether all numbers hold."""
    console = Console()

    def show(verdict: Verdict) -> None:
        console.print(f"\n[bold]{verdict.problem.name}[/]  {verdict.problem.statement}", highlight=False)
        if verdict.failure:
            console.print(f"  [red]failed[/] {verdict.failure}", highlight=False, markup=True)
        rows = [
            (f"{check.computed:.15g}", f"{check.exact:.15g}", f"{check.error:.1e}", f"{check.tolerance:.1e}")
            for check in verdict.checks
        ]
        titles = ("computed", "exact", "error", "tolerance")
        table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 1), header_style="dim")
        table.add_column("quantity", overflow="fold")
        # Numbers stand in one line each, the quantity gives way; where that is not enough they are folded, not cut.
        needed = sum(3 + max(map(len, column)) for column in zip(titles, *rows))
        for title in titles:
            table.add_column(title, justify="right", no_wrap=needed + 16 <= console.width, overflow="fold")
        table.add_column("", no_wrap=True)
        for check, numbers in zip(verdict.checks, rows):
            table.add_row(check.quantity, *numbers, "ok" if check.holds else "[red]MISS[/]")
        if verdict.checks:
            console.print(table, highlight=False)
        console.print(f"  {verdict.seconds:.2f} s", style="dim", highlight=False)

    verdicts = verify(names, tell=show, of=of)
    missed = [verdict.problem.name for verdict in verdicts if not verdict.holds]
    count = sum(len(verdict.checks) for verdict in verdicts)
    if missed:
        console.print(
            f"\n{len(missed)} of {len(verdicts)} problem{'s' * (len(verdicts) != 1)} missed: {', '.join(missed)}",
            style="red",
        )
    else:
        seconds = sum(verdict.seconds for verdict in verdicts)
        console.print(
            f"\n{len(verdicts)} problem{'s' * (len(verdicts) != 1)}: all {count} numbers agree with the exact ones, in "
            f"{seconds:.1f} s with compilation."
        )
    return not missed
