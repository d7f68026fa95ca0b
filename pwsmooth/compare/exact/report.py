"""What `pwsmooth verify` prints."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from .contract import ExactProblem, Verdict
from .verify import problems, verify


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
        table = Table("quantity", box=None, pad_edge=False, padding=(0, 2, 0, 2), header_style="dim")
        for title in ("computed", "exact", "error", "tolerance"):
            table.add_column(title, justify="right")
        table.add_column("")
        for check in verdict.checks:
            mark = "ok" if check.holds else "[red]MISS[/]"
            numbers = (
                f"{check.computed:.15g}",
                f"{check.exact:.15g}",
                f"{check.error:.1e}",
                f"{check.tolerance:.1e}",
            )
            table.add_row(check.quantity, *numbers, mark)
        if verdict.checks:
            console.print(table, highlight=False)
        console.print(f"  {verdict.seconds:.2f} s", style="dim", highlight=False)

    verdicts = verify(names, tell=show, of=of)
    missed = [verdict.problem.name for verdict in verdicts if not verdict.holds]
    count = sum(len(verdict.checks) for verdict in verdicts)
    if missed:
        console.print(f"\n{len(missed)} of {len(verdicts)} problems missed: {', '.join(missed)}", style="red")
    else:
        seconds = sum(verdict.seconds for verdict in verdicts)
        console.print(
            f"\n{count} numbers of {len(verdicts)} problems hold, in {seconds:.1f} s with compilation."
        )
    return not missed
