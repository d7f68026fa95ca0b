"""Sums of products of series, in vector registers: the two functions of generated code that are LLVM instructions."""

from __future__ import annotations

from .writer import BLOCK, BOOL, DOUBLE, FUSED, INT, LANE, LANES, NOTHING, POINTER, ROW, WIDTHS


def _spread(name: str, value: str, kind: str) -> str:
    """Lines for `name`, a vector that has the number in every lane."""
    places = f"<{WIDTHS[kind]} x {LANE}> zeroinitializer"
    return f"""
{name}.one = insertelement {kind} undef, {DOUBLE} {value}, {LANE} 0
{name} = shufflevector {kind} {name}.one, {kind} undef, {places}"""


def presum() -> tuple[str, list[str], str]:
    """presum(rows, a, b, q, out): the part of four convolutions that is known at the start of block q.

    Overwrites rows[out..out+3] with sum over 1 <= j <= 4q, k - j <= 4q of a_j b_(k-j), k = 4q+1 .. 4q+4: four
    orders in the lanes of one vector. A loop over j at every order costs four times as much: its length changes
    with k, so each of its ends is a mispredicted branch, and it reloads numbers that were only just stored.
    Four sums, because one would wait for each addition.

    Gives the kind of the result, those of the arguments, and the definition.
    """

    def add(name: str, j: str, total: str, valid: int = LANES) -> str:
        """Lines for `name`, the total and one product of a_j."""
        other, select = f"{name}.b", ""
        if valid < LANES:  # beyond are orders that do not exist yet
            other = f"{name}.valid"
            mask = ", ".join(f"{BOOL} {int(lane < valid)}" for lane in range(LANES))
            select = f"{other} = select <{LANES} x {BOOL}> <{mask}>, {BLOCK} {name}.b, {BLOCK} zeroinitializer"
        return f"""
{name}.j = add {INT} %a, {j}
{name}.from = getelementptr {DOUBLE}, {POINTER} %rows, {INT} {name}.j
{name}.number = load {DOUBLE}, {POINTER} {name}.from, align 8{_spread(f"{name}.a", f"{name}.number", BLOCK)}
{name}.k = sub {INT} %last, {j}
{name}.place = getelementptr {DOUBLE}, {POINTER} %rows, {INT} {name}.k
{name}.b = load {BLOCK}, {POINTER} {name}.place, align 8
{select}
{name} = call {BLOCK} @{FUSED[BLOCK]}({BLOCK} {name}.a, {BLOCK} {other}, {BLOCK} {total})"""

    lanes = range(LANES)
    begun = "".join(add(f"%begun{i}", f"{i + 1}", "zeroinitializer", i + 1) for i in lanes)
    sums = "\n".join(f"%sum{i} = phi {BLOCK} [ %begun{i}, %work ], [ %next{i}, %loop ]" for i in lanes)
    more = "".join(f"\n%j{i} = add {INT} %j, {i}{add(f'%next{i}', f'%j{i}', f'%sum{i}')}" for i in lanes)
    totals = "\n".join(
        f"%total{i} = phi {BLOCK} [ zeroinitializer, %entry ], [ %sum{i}, %test ]" for i in lanes
    )
    text = f"""
define internal void @presum(ptr %rows, {INT} %a, {INT} %b, {INT} %q, {INT} %out) {{
entry:
%known = mul {INT} %q, {LANES}
%end = add {INT} %b, %known
%last = add {INT} %end, 1
%any = icmp sgt {INT} %q, 0
br {BOOL} %any, label %work, label %done
work:{begun}
br label %test
test:
%j = phi {INT} [ {LANES + 1}, %work ], [ %after, %loop ]
{sums}
%on = icmp sle {INT} %j, %known
br {BOOL} %on, label %loop, label %done
loop:{more}
%after = add {INT} %j, {LANES}
br label %test
done:
{totals}
%low = fadd {BLOCK} %total0, %total1
%high = fadd {BLOCK} %total2, %total3
%all = fadd {BLOCK} %low, %high
%to = getelementptr {DOUBLE}, {POINTER} %rows, {INT} %out
store {BLOCK} %all, {POINTER} %to, align 8
ret void
}}"""
    return NOTHING, [POINTER, INT, INT, INT, INT], text


def combine(name: str, count: int) -> tuple[str, list[str], str]:
    """combine(rows, out, value, table, stride, K, c_0, c_1, ...): value + sum_j c_j times the row at table + j stride.

    Overwrites orders 0..K of the row at `out`, and with zeros what is left of the last block of eight.
    Gives the kind of the result, those of the arguments, and the definition.
    """
    given = "".join(f", {DOUBLE} %c{j}" for j in range(count))
    factors = "".join(_spread(f"%factor{j}", f"%c{j}", ROW) for j in range(count))
    terms = "".join(
        f"""
%offset{j} = mul {INT} %stride, {j}
%row{j} = add {INT} %table, %offset{j}
%place{j} = add {INT} %row{j}, %start
%from{j} = getelementptr {DOUBLE}, {POINTER} %rows, {INT} %place{j}
%response{j} = load {ROW}, {POINTER} %from{j}, align 8
%total{j + 1} = call {ROW} @{FUSED[ROW]}({ROW} %factor{j}, {ROW} %response{j}, {ROW} %total{j})"""
        for j in range(count)
    )
    text = f"""
define internal void @{name}(ptr %rows, {INT} %out, {DOUBLE} %value, {INT} %table, {INT} %stride, {INT} %K{given}) {{
entry:
%first = insertelement {ROW} zeroinitializer, {DOUBLE} %value, {LANE} 0{factors}
br label %loop
loop:
%start = phi {INT} [ 0, %entry ], [ %following, %loop ]
%total0 = phi {ROW} [ %first, %entry ], [ zeroinitializer, %loop ]{terms}
%place = add {INT} %out, %start
%to = getelementptr {DOUBLE}, {POINTER} %rows, {INT} %place
store {ROW} %total{count}, {POINTER} %to, align 8
%following = add {INT} %start, {WIDTHS[ROW]}
%on = icmp sle {INT} %following, %K
br {BOOL} %on, label %loop, label %end
end:
ret void
}}"""
    return NOTHING, [POINTER, INT, DOUBLE, INT, INT, INT, *[DOUBLE] * count], text
