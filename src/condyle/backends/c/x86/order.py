"""The order of instructions: none waits long, and few values wait in registers.

A processor looks a few hundred instructions ahead, but fills its queues with what waits. So they
are put in the order in which they could start, two a cycle. Of those whose arguments are there a
batch takes the program's first, one evaluation the one with the longest way still to go; until many
values are live: then the one that leaves the fewest behind.
"""

from __future__ import annotations

import heapq
from bisect import insort
from collections.abc import Sequence

from .listing import Instruction

ISSUE = 2  # instructions a cycle
WINDOW = 512  # instructions of a batch among which the next is looked for
CROWD = 1.5  # live values a register, from which few new ones are wanted
CHOICE = 24  # of those that could start, how many are compared
LATENCY = {"div": 13, "sqrt": 20, "rsqrt": 6, "add": 3, "sub": 3, "mul": 3, "spread": 3}
LATENCY |= {"and": 1, "or": 1, "xor": 1, "unpack": 1}
USUAL = 4  # cycles of everything else


def ordered(
    code: Sequence[Instruction], registers: int, hurried: bool = False
) -> list[Instruction]:
    """The same instructions; arguments stay first.

    Args: hurried: whether it is the last result that counts, and not how many a second.
    """
    where = {instruction.to: i for i, instruction in enumerate(code) if instruction.to is not None}
    needs = [[where[a] for a in dict.fromkeys(i.args) if a in where] for i in code]
    users: list[list[int]] = [[] for _ in code]
    for i, args in enumerate(needs):
        for j in args:
            users[j].append(i)
    rank = _by_way(code, users) if hurried else range(len(code))
    window = len(code) if hurried else WINDOW
    missing = [len(args) for args in needs]  # arguments that were not issued yet
    left = [len(own) for own in users]  # users that were not issued yet
    at = [0] * len(code)  # the cycle at which it could start, as far as known
    ready: list[int] = []
    future: list[tuple[int, int]] = []
    order: list[Instruction] = []
    entered = live = cycle = 0
    many = CROWD * registers

    def growth(i: int) -> int:
        """Values more that are live after an instruction than before it."""
        return (left[i] > 0) - sum(left[j] == 1 for j in needs[i])

    while len(order) < len(code):
        while entered < len(code) and entered - len(order) < window:
            if not missing[entered]:
                heapq.heappush(future, (at[entered], entered))
            entered += 1
        while future and future[0][0] <= cycle:
            insort(ready, heapq.heappop(future)[1], key=rank.__getitem__)
        for _ in range(min(ISSUE, len(ready))):
            best = ready[0] if live <= many else min(ready[:CHOICE], key=growth)
            ready.remove(best)
            live += growth(best)
            order.append(code[best])
            done = cycle + _latency(code[best])
            for j in needs[best]:
                left[j] -= 1
            for user in users[best]:
                missing[user] -= 1
                at[user] = max(at[user], done)
                if not missing[user] and user < entered:
                    heapq.heappush(future, (at[user], user))
        cycle += 1
    return order


def _by_way(code: Sequence[Instruction], users: list[list[int]]) -> list[int]:
    """Rank of each instruction: the one with the longest way to the last result comes first."""
    way = [0] * len(code)
    for i in range(len(code) - 1, -1, -1):
        way[i] = _latency(code[i]) + max((way[user] for user in users[i]), default=0)
    rank = [0] * len(code)
    for k, i in enumerate(sorted(range(len(code)), key=lambda i: -way[i])):
        rank[i] = k
    return rank


def _latency(instruction: Instruction) -> int:
    return LATENCY.get(instruction.op, USUAL)
