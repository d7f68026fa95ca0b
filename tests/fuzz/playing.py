"""All cases of a structure are played, here or in other processes.

Chain: the fuzzers -> **playing** -> __main__.py.
"""

from __future__ import annotations

import gc
import importlib
import multiprocessing
import multiprocessing.connection
import time
from collections import Counter

from . import judging

SLOW = 5.0  # seconds of a case that are reported
DIED = judging.WRONG, "the process died"  # in machine code
ENDLESS = judging.UNDECIDED, "no end of a case in sight"
PATIENCE = 600.0  # seconds for a case, or for making a model
MOST = 150  # structures of a process, of which each leaves some megabytes behind


def one_structure(name, seed, number, cases, known=(), note=lambda case: None):
    """Counts and failures of one structure's cases, as JSON has them.

    Of some the (case, kind, reason) is `known`, for they ended a process; each other one is played, and `note` told.
    """
    judging.spent()
    module = importlib.import_module(f".{name}", __package__)
    counts, failures, slow, too_slow, examples = Counter(), [], [], [], {}
    key = seed * 100_000 + number
    try:
        played = getattr(module, "compiled", judging.compiled)(module, key)
    except Exception as error:  # a model that the package refuses to build is a finding
        return of_no_case(key, cases, judging.WRONG, f"structure raised {type(error).__name__}: {error}")
    play = getattr(module, "play", judging.play)
    for i in range(cases):
        before = time.monotonic()
        ended = [judging.Verdict(*how) for case, *how in known if case == key * 1000 + i]
        if not ended:
            note(key * 1000 + i)
        verdict = ended[0] if ended else play(played, key * 1000 + i)
        what = " ".join(filter(None, (verdict.kind, verdict.reason)))[:60]
        counts[what] += 1
        if verdict.kind != judging.RIGHT:
            examples.setdefault(what, [key, key * 1000 + i])
        if verdict.kind == judging.WRONG:
            failures.append([key, key * 1000 + i, verdict.reason, verdict.error, verdict.tags])
        if verdict.reason in (judging.TOO_SLOW, ENDLESS[1]):
            too_slow.append([key, key * 1000 + i])
        if time.monotonic() - before > SLOW and i:
            slow.append([key, key * 1000 + i, round(time.monotonic() - before, 1)])
    return {"structure": number, "counts": counts, "failures": failures, "slow": slow, "too slow": too_slow,
            "examples": examples, "parts": judging.spent()}  # fmt: skip


def of_no_case(key, cases, kind, text):
    """What is found in a structure of which no case can be played."""
    wrong = kind == judging.WRONG
    return {
        "structure": key % 100_000,
        "counts": {kind if wrong else f"{kind} {text}": cases},
        "failures": [[key, -1, text[:300], 0, 0]] if wrong else [],
        "too slow": [] if wrong else [[key, -1]],
        "parts": judging.spent(),
    }


def _work(pipe):
    collect_seldom()
    while arguments := pipe.recv():
        pipe.send((True, one_structure(*arguments, note=lambda case: pipe.send((False, case)))))


def played_apart(left, jobs):
    """What is found in structures that are played by other processes.

    A process that dies, or that is silent for longer than PATIENCE and is ended, is replaced; its case is kept.
    """
    context = multiprocessing.get_context("spawn")
    waiting, working = list(left)[::-1], {}
    known = {arguments: [] for arguments in left}

    def start(pipe, worker, played):
        """The next structure for a worker that has played so many."""
        arguments = waiting.pop()
        working[pipe] = worker, played, arguments, None, time.monotonic()
        pipe.send((*arguments, known[arguments]))

    while waiting or working:
        while waiting and len(working) < jobs:
            pipe, end = context.Pipe()
            worker = context.Process(target=_work, args=[end], daemon=True)
            worker.start()
            end.close()
            start(pipe, worker, 0)
        heard = multiprocessing.connection.wait(list(working), timeout=10)
        silent = [pipe for pipe, at in working.items() if at[-1] < time.monotonic() - PATIENCE]
        for pipe in {*heard, *silent}:
            worker, played, arguments, case, _ = working.pop(pipe)
            try:
                if pipe not in heard:
                    worker.kill()
                finished, found = pipe.recv()
            except (EOFError, ConnectionError):
                worker.join()
                how = DIED if pipe in heard else ENDLESS
                if case is None or (how is ENDLESS and known[arguments]):  # its model, or more than one case
                    yield of_no_case(arguments[1] * 100_000 + arguments[2], arguments[3], *how)
                else:
                    known[arguments].append((case, *how))
                    waiting.append(arguments)
                continue
            if not finished:
                working[pipe] = worker, played, arguments, found, time.monotonic()
                continue
            yield found
            if waiting and played < MOST:
                start(pipe, worker, played + 1)
            else:
                pipe.send(None)


def collect_seldom():
    """What is made here are expressions and programs, millions of objects and hardly a circle of them."""
    gc.set_threshold(200_000, 20, 20)
