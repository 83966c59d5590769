"""One evaluation as instructions: chains in the lanes, shared values in the first alone."""

from __future__ import annotations

from functools import reduce

from ....graph.graph import Value
from ....graph.schedule import scheduled
from ..straight import Straight
from .listing import Listing, Name, contracted
from .lower import Lowering, integer

# Below pi/4 nothing is taken off an angle; beyond, the C library is asked, which takes longer.
NEAR = 0.785


def single(straight: Straight) -> Listing:
    """The instructions of one evaluation, those with the longest way to go first."""
    return _Single(straight).run()


class _Single(Lowering):
    """Shared values are about one lane, sums over the chains about ever fewer."""

    def __init__(self, straight: Straight) -> None:
        super().__init__(straight)
        self.straight, self.width = straight, straight.width
        self.now = 1  # lanes that are worked on
        self.rows: set[Name] = set()  # values that have all lanes
        self.spread: dict[Name, Name] = {}
        self.near: dict[Name, tuple[Name, Name, Name]] = {}

    def run(self) -> Listing:
        straight = self.straight
        bundles = {bundle[0]: bundle for bundle in straight.bundles()}
        for v in scheduled(straight.g, straight.varying, list(bundles.values())):
            group = straight.g.nodes[v].group
            self.now = 1 if group is None else self.width
            if v in bundles:
                self._sums(bundles[v])
                continue
            for copy in range(1 if group is None else straight.copies[group]):
                self.define(v, copy)
        for slot, v, copy, used in straight.stored():
            self._store(slot, v, copy, used)
        self.listing.code = contracted(self.listing.code)
        return self.listing

    def _store(self, slot: int, v: Value, copy: int, used: int) -> None:
        own = self.named(v, copy)
        if used == 1 and not self._is_row(own):
            self.listing.store(slot, own, 1)
            return
        own, some = self._row(own), self.width
        while used:
            if used >= some:
                self.listing.store(slot, own, some)
                slot, used = slot + some, used - some
                own = self._upper(own, some) if used else own
            some //= 2

    # -- values ------------------------------------------------------------------------------

    def add(self, op: str, *args: Name, data: object = None) -> Name:
        if self.now == 1:
            return self._about(1, op, *args, data=data)
        to = self._about(self.width, op, *(self._row(a) for a in args), data=data)
        self.rows.add(to)
        return to

    def _about(self, lanes: int, op: str, *args: Name, data: object = None) -> Name:
        """The value of an instruction about so many lanes."""
        return self.listing.add(op, *args, data=data, lanes=lanes)

    def _is_row(self, value: Name) -> bool:
        """Whether a value, or what stands in memory, has all lanes."""
        if value < 0:
            return self.listing.home(value).kind in ("row", "given_row")
        return value in self.rows

    def _row(self, value: Name) -> Name:
        """A value in all lanes; AVX-512 spreads what stands in memory as it reads it."""
        literal = value < 0 and self.listing.home(value).kind == "literal"
        if self._is_row(value) or literal or (value < 0 and self.width == 8):
            return value
        if value not in self.spread:
            self.spread[value] = self._about(self.width, "spread", value)
            self.rows.add(self.spread[value])
        return self.spread[value]

    def fixed(self, v: Value, copy: int) -> Name:
        kind = "table" if self.nodes[v].group is None else "row"
        return self.listing.place(kind, self.straight.slot(v, copy * self.width))

    def given(self, v: Value, copy: int) -> Name:
        op, data = self.nodes[v].op, self.nodes[v].data
        if op == "input":
            return self.listing.place("given", integer(data[0]))
        return self.listing.place("given_row", integer(data[1]) + copy * self.width)

    def estimates(self) -> bool:
        return self.now == 8

    def sine(self, x: Name) -> Name:
        if self.now != 1:
            return super().sine(x)
        sine, _, near = self._close(x)
        return self.add("mend", sine, near, x, data="sin")

    def cosine(self, x: Name) -> Name:
        if self.now != 1:
            return super().cosine(x)
        _, cosine, near = self._close(x)
        return self.add("mend", cosine, near, x, data="cos")

    def _close(self, x: Name) -> tuple[Name, Name, Name]:
        """Sine and cosine of an angle close to zero, as those of home are, and whether it is."""
        if x not in self.near:
            z = self.add("mul", x, x)
            near = self.add("lt", self.fabs(x), self.listing.number(NEAR))
            self.near[x] = *self.polynomials(x, z), near
        return self.near[x]

    # -- sums and minima over the chains -----------------------------------------------------

    def _terms(self, v: Value) -> list[Name]:
        terms = self.straight.lane_terms(v)
        return [self.named(t, c) for group, t in terms for c in range(self.straight.copies[group])]

    def _folded(self, op: str, terms: list[Name]) -> Name:
        """Rows, lane by lane, in one."""
        rows = [self._row(t) for t in terms]
        return reduce(lambda a, b: self._about(self.width, op, a, b), rows)

    def _upper(self, value: Name, lanes: int) -> Name:
        """The upper half of the first 2 `lanes` lanes."""
        if lanes == 1:
            return self._about(2, "unpack", value, value, data=1)
        return self._about(lanes, "extract", value)

    def reduction(self, v: Value) -> Name:
        self.now = 1
        terms = self._terms(v)
        if not terms:
            return self.with_shared(v, None)
        op = "add" if self.nodes[v].op == "sum" else "min"
        total, lanes = self._folded(op, terms), self.width
        while lanes > 1:
            lanes //= 2
            total = self._about(lanes, op, total, self._upper(total, lanes))
        return self.with_shared(v, total)

    def _sums(self, bundle: list[Value]) -> None:
        """Two or four sums in fewer steps than one by one."""
        rows = [self._folded("add", self._terms(v)) for v in bundle]
        pairs = [self._paired(a, b) for a, b in zip(rows[::2], rows[1::2], strict=True)]
        lanes = self.width
        if len(pairs) == 2:
            low, high = pairs
            if lanes == 8:
                # Quarters 0 2 of both and quarters 1 3 of both, then one half on the other.
                low = self._quarters(8, low, high, 0x88, 0xDD)
                high = self._about(4, "extract", low)
            total = self._quarters(4, low, high, 0, 3)
            self._found(bundle[:2], total)
            self._found(bundle[2:], self._about(2, "extract", total))
            return
        total = pairs[0]
        while lanes > 2:
            lanes //= 2
            total = self._about(lanes, "add", total, self._about(lanes, "extract", total))
        self._found(bundle, total)

    def _paired(self, a: Name, b: Name) -> Name:
        """a b a b ..., each the sum of two neighbours."""
        low, high = (self._about(self.width, "unpack", a, b, data=half) for half in (0, 1))
        return self._about(self.width, "add", low, high)

    def _quarters(self, lanes: int, a: Name, b: Name, one: int, other: int) -> Name:
        """Some quarters (or halves) of two vectors and the others, added."""
        parts = (self._about(lanes, "halves", a, b, data=which) for which in (one, other))
        return self._about(lanes, "add", *parts)

    def _found(self, two: list[Value], total: Name) -> None:
        """Two sums, which stand side by side."""
        first, second = two
        self.found[first, None] = total
        self.found[second, None] = self._upper(total, 1)
