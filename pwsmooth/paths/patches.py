"""The small system that a patch of elements is, as the kernels of all systems know systems: its arrays.

One block serves all patches of an Assembly, with room that grows with the largest of them.
Chain: local.py -> **this file** -> kernels/local/patch.py, which sets the arrays' extents anew for every patch.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..kernels import state as names
from .problem import MOST, longest_step

_FIRST_ROOM = 256  # members and places of a patch
_STRUCK = 512  # contacts and friction that one impact may strike
_RUBS = (names.SLIDING, names.COMPONENT)
_TOUCHING = 2048  # contacts of a patch that touch at one instant
_EMPTY = np.zeros(0, np.int64)


class SmallSystem:
    """The bundles P, C, S, R, W of an Assembly A, with a copy of the machine code that no other one uses."""

    def __init__(self, run: Any, code: Any, A: Any):
        self.run, self.code, self.A = run, code, A
        self._make(_FIRST_ROOM)

    @property
    def addresses(self) -> list[int]:
        """Of A, P, C, S, R, W."""
        return [b.address for b in (self.A, self.P, self.C, self.S, self.R, self.W)]

    def enlarge(self) -> None:
        """Makes room for what the last call had none for."""
        A, run = self.A, self.run
        if A.patch.needs:
            self._make(max(2 * self.most, A.patch.needs))
            A.patch.needs = 0
            return
        logs = (("event_t", "event", "event_x"), A.events), (("ambiguity_t", "ambiguity"), A.ambiguities)
        for arrays, count in logs:
            room = count + 16 * (run.nm + run.ne) * self.most + 1024
            for name in arrays:
                old = getattr(A, name)
                if len(old) < room:
                    new = np.zeros((2 * room, *old.shape[1:]), old.dtype)
                    new[:count] = old[:count]
                    type(A).members[name].give(A, new)

    def _sizes(self, members: int, places: int) -> dict[str, int]:
        """Of the arrays."""
        run = self.run
        m, ne = run.fixed_m + run.blocks_m * members, run.ne * members
        rows = own = 0
        for of in run.rows.values():
            states = min(of["blocks"], run.ns)
            rows = max(rows, of["fixed"] + states * places + (of["blocks"] - states) * members)
            fixed, each = of["scratch"]
            own = max(own, -(-(fixed + each * places) // self.stride))
        rows += own
        coupled = len(run.template.linked)
        rubs = (
            (run.contacts + run.blocks_m) * run.n
            if run.contacts and np.isin(run.parts.kind, _RUBS).any()
            else 0
        )
        entries, gradients = run.fixed_m + len(run.g_block) * members, len(run.dh_block) * members
        return {
            "n": run.ns * places, "m": m, "ne": ne, "nz": 0,
            "blocks": run.fixed_m + run.own_groups * members + int(coupled > 0),
            "width": self.stride, "rows": rows, "fold_size": 0, "entries": entries,
            "gradients": gradients + m + ne, "fold_entries": 0, "fold_gradients": 0,
            "group": max(*map(len, run.groups), min(coupled * run.n, _TOUCHING), 0),
            "hubs": 0, "onset": 0, "room": 16,
            "contacts": min(run.contacts * run.n, _TOUCHING), "contact": run.contacts * members,
            "joint": min(coupled * run.n, MOST), "struck": min(rubs, _STRUCK),
            "pieces": 0, "polynomials": 0, "order": 0, "tapes": 0, "times": 0, "pushes": 0,
            "p": len(run.p_fixed) - len(run.own_parameters)
            + (len(run.own_parameters) + len(run.template.felt)) * places,
            "g_col": entries, "link_col": len(run.link_block) * members, "dh_col": gradients,
            **{f"flat_{name}": int((1 + (members - 1) * of["flat_own"]).sum()) for name, of in run.rows.items()},
            "block_member": run.fixed_m + (len(run.group_block) + coupled) * members,
        }  # fmt: skip

    def _make(self, most: int) -> None:
        """The arrays with room for so many members and places."""
        run = self.run
        self.stride = run.width + names.PAD
        sizes = self._sizes(most, most)
        fixed, code = run.parts.fixed, self.code.address
        open_ended = {
            name: np.zeros(sizes.get(name, 0), np.int64)
            for name in ("g_col", "link_col", "dh_col", "block_member", "flat_slip", "flat_general", "contact")
        }
        numbers = {
            name: value for name, value in fixed.items()
            if isinstance(names.Problem.members[name], type(names.Problem.members["n"]))
        }  # fmt: skip
        numbers |= {
            "fields": code["fields"], "linear": code["linear"], "act": code["act"] if run.parts.acts else 0,
            "jet_slip": code["slip"], "jet_general": code["general"],
        }  # fmt: skip
        empty = {name: _EMPTY for name in ("fold_col", "hub", "flat_fold")}
        self.P = names.Problem.zeros(
            sizes, **numbers, **empty, **open_ended, p=np.zeros(sizes["p"]), fold_bias=np.zeros(0)
        )
        self.P.weight[:] = 1.0
        self.P.disc_of[:] = self.P.holder[:] = -1
        self.P.watch_state[:] = self.P.unknowns[:] = -1
        self.P.rows_fold[:] = self.P.rows_pair[:] = -1
        options = run.options
        self.C = names.Control.zeros(
            sizes, order=run.order, rtol=options.rtol, max_step=min(options.max_step, longest_step(run.order)),
            max_steps=2**62, strict=int(options.strict), clock=np.empty(0), clock_event=_EMPTY,
            clock_side=_EMPTY,
        )  # fmt: skip
        self.S = names.State.zeros(sizes)
        log = 8 * (run.nm + run.ne) * most + 128
        given = dict(
            event_t=np.zeros(log), event=np.zeros((log, 4), np.int64), most_events=log,
            ambiguity_t=np.zeros(log), ambiguity=np.zeros((log, 3), np.int64),
        )  # fmt: skip
        self.R = names.Record.zeros(sizes, **given)
        self.W = run.parts.new_work(run.order, sizes)
        instant, step = self.W.instant, self.W.step
        instant.fold = instant.rests = step.refused = -1
        self.most = most
        table = [
            [*cell] for bundle in (self.P, self.C, self.S, self.R, self.W)
            for cell in self._cells(bundle, given if bundle is self.R else ())
        ]  # fmt: skip
        table += [[address, 0, 1, 0] for address in self.code.sizes[0]]
        table += [[address, 0, 0, 1] for address in self.code.sizes[1]]
        near, number = np.zeros(len(self.code.offsets) * most + 1), np.zeros(most + 1)
        self.code.give(near, number)
        patch = self.A.patch
        for name, given in (("cell", np.array(table, np.int64)), ("near", near), ("number", number)):
            patch.members[name].give(patch, given)
        patch.shaped[:] = -1
        patch.most = most

    def _cells(self, bundle: Any, given: Any) -> Any:
        """(address, so many at least, for each member, for each place) of the extents of a Bundle's arrays."""
        base, of_member, of_place = (self._sizes(*k) for k in ((0, 0), (1, 0), (0, 1)))
        kinds = type(bundle).members
        for name, member in kinds.items():
            if hasattr(member, "struct"):
                yield from self._cells(getattr(bundle, name), ())
                continue
            if not hasattr(member, "shape") or member.pointer or name in given:
                continue
            for axis, size in enumerate(member.shape):
                at = bundle.address + 8 * (member.at + 1 + axis)
                if size == ":":
                    first, each, place = (s.get(name, 0) for s in (base, of_member, of_place))
                else:
                    first, each, place = (_extent(size, s) for s in (base, of_member, of_place))
                if each != first or place != first:
                    yield at, first, each - first, place - first


def _extent(size: str, sizes: dict[str, int]) -> int:
    from ..kernels.machine.block import _product

    return sum(_product(term, sizes) for term in size.split("+"))
