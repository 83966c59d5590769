"""Assembly before it is printed: lowered, put in order, given registers.

No compiler and no particular processor is needed; `test_x86_batch` runs what is printed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from support.cases import case, error
from support.programs import LANES, no_numbers, program
from support.x86 import NEVER, Reads, Step, loads, random_listing, run_by_name, run_by_number

from condyle.backends.c.emit import fused
from condyle.backends.c.loops import LONG, Loops
from condyle.backends.c.straight import Straight
from condyle.backends.c.x86.allocate import allocated
from condyle.backends.c.x86.batch import batch
from condyle.backends.c.x86.listing import Instruction, Listing, Name, contracted
from condyle.backends.c.x86.order import ordered
from condyle.backends.c.x86.single import single
from condyle.backends.c.x86.text import REGISTERS
from condyle.backends.numpy import NumpyKernel
from condyle.dynamics import FORMULATIONS
from condyle.graph.graph import Graph
from condyle.graph.operations import REDUCTIONS
from condyle.graph.program import Numbers, Output, Port, Program, Variants
from condyle.mechanism import load
from condyle.mechanism.home import independent_coordinates
from condyle.mechanism.library import bundled_mechanisms
from condyle.questions import QUESTIONS, Prescribed, Question
from condyle.questions.numbers import Layout
from condyle.questions.structure import structure_of

MECHANISMS = bundled_mechanisms()
FEW = (5, 6, 9)  # five is what a call asks for: four arguments, and a copy of one that stays
SEEDS = range(12)
NUMBERS = [
    *(("virtual_power", "core", width) for width in REGISTERS),
    ("momentum", "direct", 8),
    ("lagrange", "core", 4),
    ("hessian", "core", 8),
    ("newton_euler", "direct", 4),
]
TOLERANCE = 1e-12  # as of every other way to run a question; see test_values


def variants(mechanism: str, question: str, formulation: str, route: str) -> Variants:
    own = load(mechanism)
    given = Prescribed(independent_coordinates(own))
    details = (given,) if question in ("closure", "conditions") else ()
    return Question.about(structure_of(own, formulation, route), question, *details).variants()


def step(mechanism: str, question: str, formulation: str, route: str, width: int) -> Loops:
    """A question's batch step, as `emit` has it."""
    return Loops(fused(variants(mechanism, question, formulation, route).main), width)


def dealt() -> list[tuple[str, str, str, int]]:
    """Every question of the reference, and every fourth of each other mechanism, in turn.

    By another formulation from one to the next, on 16 and on 32 registers.
    """
    found = []
    for i, mechanism in enumerate(MECHANISMS):
        for j, question in enumerate(QUESTIONS):
            nothing_to_close = question == "closure" and not load(mechanism).contacts
            if mechanism == "masticatory" or ((i + j) % 4 == 0 and not nothing_to_close):
                formulation = list(FORMULATIONS)[(i + j) % len(FORMULATIONS)]
                found.append((mechanism, question, formulation, (4, 8)[(i + j // 4) % 2]))
    return found


def check_order(order: Sequence[Instruction], code: Sequence[Instruction]) -> None:
    """The same instructions, arguments first."""
    assert Counter(order) == Counter(code)
    defined: set[Name] = set()
    for _, to, args, _, _ in order:
        assert all(a < 0 or a in defined for a in args)
        if to is not None:
            defined.add(to)


def check_whole(code: Sequence[Instruction], registers: int, hurried: bool = False) -> None:
    """Order and allocation of a listing, from one end to the other."""
    order = ordered(code, registers, hurried)
    check_order(order, code)
    run_by_name(order, allocated(order, registers), registers)


def check_numbers(loops: Loops, numbers: Numbers, inputs: dict[str, np.ndarray]) -> None:
    """Move by move, on numbers: as the backend of numpy."""
    listing, registers = batch(loops), REGISTERS[loops.width]
    moves, _ = allocated(ordered(listing.code, registers), registers)
    state = Step(loops, numbers, inputs)
    rows = run_by_number(moves, state.home(listing), len(outputs(listing.code)))
    wanted = NumpyKernel(Variants(loops.program), numbers).run(inputs).values
    for name, value in state.values(rows).items():
        assert error(value, wanted[name]) < TOLERANCE, name


def outputs(code: Sequence[Instruction]) -> list[int]:
    return [i.data for i in code if i.op == "output" and isinstance(i.data, int)]


# -- every question of every mechanism ---------------------------------------------------------


@pytest.mark.parametrize(("mechanism", "question", "formulation", "width"), dealt())
def test_questions(mechanism: str, question: str, formulation: str, width: int) -> None:
    loops = step(mechanism, question, formulation, "core", width)
    code = batch(loops).code
    assert sorted(outputs(code)) == list(range(len(list(loops.outputs()))))
    check_whole(code, REGISTERS[width])


@pytest.mark.parametrize("width", REGISTERS)
@pytest.mark.parametrize("question", ["inverse", "forward"])
@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_one_evaluation(mechanism: str, question: str, width: int) -> None:
    """Of each program that `emit` prints: results are stored once, by ones, twos, fours, eights."""
    own = variants(mechanism, question, "virtual_power", "core")
    assert own.single
    for p in (own.latency or own.main, own.robust):
        if p is None:
            continue
        straight = Straight(fused(p), width)
        code = single(straight).code
        check_whole(code, REGISTERS[width], hurried=True)
        stored = [i.data + k for i in code if i.op == "output" for k in range(i.lanes)]
        wanted = [at + k for at, _, _, used in straight.stored() for k in range(used)]
        assert stored == wanted == list(range(len(wanted)))


@pytest.mark.parametrize(("formulation", "route", "width"), NUMBERS)
def test_numbers(formulation: str, route: str, width: int) -> None:
    """Inverse dynamics of the reference."""
    c = case("masticatory")
    loops = step("masticatory", "inverse", formulation, route, width)
    numbers = Layout.of(structure_of(c.mechanism, formulation, route)).numbers(c.mechanism)
    check_numbers(loops, numbers, c.inputs)


def test_reductions() -> None:
    """Sums and minima over chains of two groups: of products, of differences, of what all share."""
    graph, (near, far) = Graph(), (3, 2)
    x = graph.leaf("input", 0)
    a, b = graph.leaf("lane_input", 0, 1, group=0), graph.leaf("lane_input", 1, 1 + near, group=1)
    c = graph.leaf("lane", 0, 0, group=0)
    product, difference = graph.apply("mul", a, c), graph.apply("sub", graph.apply("mul", b, b), b)
    roots = [graph.reduce("sum", [product, difference])]
    for op in REDUCTIONS:
        roots += [graph.reduce(op, terms) for terms in ([a, b], [x, b], [a, x], [x, x])]
    outputs = tuple(Output(str(i), (), "", False, ((v,),)) for i, v in enumerate(roots))
    ports = (Port("x", 1, "", False, 0), Port("y", 1, "", True, 1))
    p = Program(graph, (near, far), 1 + near + far, ports, outputs, ())
    fixed = (np.array([[2.0, -3.0, 5.0]]), np.zeros((1, far)))
    numbers = Numbers(np.zeros(1), fixed, (np.zeros(1), np.zeros(1)), (3, 0, 4, 1, 2))
    x_and_y = np.random.default_rng(0).normal(size=(7, p.columns))
    check_numbers(Loops(fused(p), 4), numbers, {"x": x_and_y[:, :1], "y": x_and_y[:, 1:]})


def test_long_chains() -> None:
    """C has them in a loop; here they are as any other."""
    graph = Graph()
    v = first = graph.leaf("lane_input", 0, 0, group=0)
    for _ in range(LONG):
        v = graph.apply("add", graph.apply("mul", v, graph.const(0.5)), first)
    p = program(graph, [graph.reduce("sum", [v])], LANES)
    p = replace(p, ports=(Port("y", 1, "", True, 0),))
    loops = Loops(fused(p), 8)
    assert loops.rolled
    check_numbers(loops, no_numbers(), {"y": np.random.default_rng(0).normal(size=(5, LANES))})


@pytest.mark.parametrize("registers", [*FEW, *REGISTERS.values()])
def test_random_listings(registers: int) -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        check_whole(random_listing(rng, int(rng.integers(2, 120))), registers)


# -- order -------------------------------------------------------------------------------------


def listing_of(*lines: tuple[str, Name | None, tuple[Name, ...]]) -> list[Instruction]:
    return [Instruction(*line) for line in lines]


def sum_of_products(count: int) -> list[Instruction]:
    """All products, then their sums by twos: so many values wait."""
    code = [Instruction("mul", 1 + i, (-1 - i, -2 - i)) for i in range(count)]
    code += [Instruction("add", count + i, (2 * i - 1, 2 * i)) for i in range(1, count)]
    return [*code, Instruction("output", None, (2 * count - 1,), 0)]


def live(code: Sequence[Instruction]) -> int:
    """How many values that were computed wait at most."""
    reads = Reads(code)
    made: list[Name] = []
    most = 0
    for i, instruction in enumerate(code):
        made += [instruction.to] if instruction.to is not None else []
        made = [v for v in made if reads.after(v, i + 1) != NEVER]
        most = max(most, len(made))
    return most


def test_order_is_the_same_every_time() -> None:
    code = random_listing(np.random.default_rng(1), 300)
    assert ordered(code, 16) == ordered(list(code), 16)


def test_the_longest_way_goes_first() -> None:
    """In one evaluation; a batch keeps the program's order."""
    free = listing_of(*(("mul", k, (-1, -2)) for k in range(20, 24)))
    chain = listing_of(("sqrt", 1, (-1,)), *(("add", k + 1, (k, -1)) for k in range(1, 9)))
    assert ordered([*free, *chain], 16, hurried=True)[0] == chain[0]
    assert ordered([*free, *chain], 16)[0] == free[0]


def test_what_waits_lets_others_pass() -> None:
    """A quotient takes long; what needs it comes after all that does not."""
    quotient = listing_of(("div", 1, (-1, -2)), ("add", 2, (1, -1)))
    others = listing_of(*(("mul", k, (-1, -2)) for k in range(3, 15)))
    order = ordered([*quotient, *others], 16)
    assert order[0].op == "div" and order[-1].op == "add"
    assert order[1:-1] == others


def test_what_ends_values_comes_first_when_registers_are_gone() -> None:
    code = sum_of_products(32)
    assert live(code) == live(ordered(code, 32)) == 32
    assert live(ordered(code, 8)) <= 16


def test_nothing_is_taken_from_far_ahead() -> None:
    """A processor looks a few hundred instructions ahead, and so does the order."""
    chain = listing_of(("add", 1, (-1, -1)), *(("add", k + 1, (k, k)) for k in range(1, 1500)))
    free = listing_of(*(("mul", 2000 + k, (-1, -2)) for k in range(1500)))
    where = {instruction: i for i, instruction in enumerate([*chain, *free])}
    for issued, instruction in enumerate(ordered([*chain, *free], 16)):
        assert where[instruction] - issued < 512


# -- registers ---------------------------------------------------------------------------------


def pages(*wanted: Name) -> list[Instruction]:
    """Stores of what stands in memory, which go through a register: paging and nothing else."""
    return [Instruction("output", None, (v,), i) for i, v in enumerate(wanted)]


def fewest(wanted: Sequence[Name], registers: int) -> int:
    """Loads that are enough, by trying everything."""

    @cache
    def more(i: int, held: frozenset[Name]) -> int:
        if i == len(wanted):
            return 0
        if wanted[i] in held:
            return more(i + 1, held)
        kept = combinations(held, min(len(held), registers - 1))
        return 1 + min(more(i + 1, frozenset({*some, wanted[i]})) for some in kept)

    return more(0, frozenset())


def test_the_textbook_example() -> None:
    """Three registers: nine loads, as operating systems' textbooks count them."""
    wanted = [-1 - p for p in (7, 0, 1, 2, 0, 3, 0, 4, 2, 3, 0, 3, 2, 1, 2, 0, 1, 7, 0, 1)]
    code = pages(*wanted)
    allocation = allocated(code, 3)
    run_by_name(code, allocation, 3)
    assert loads(allocation.moves) == fewest(wanted, 3) == 9


def test_loads_are_the_fewest() -> None:
    rng = np.random.default_rng(2)
    for registers in (2, 3, 4):
        for _ in range(10):
            wanted = rng.integers(-7, 0, 24).tolist()
            got = loads(allocated(pages(*wanted), registers).moves)
            assert got == fewest(wanted, registers)


def test_enough_registers_need_no_memory() -> None:
    code = sum_of_products(20)
    moves, slots = allocated(code, 24)
    assert not slots
    assert {move.op for move in moves} <= {"mul", "add", "output", "load"}


def test_slots_are_used_again() -> None:
    """Forty values wait twice over, the second time where the first have gone."""
    once = sum_of_products(40)
    again = [
        i._replace(to=i.to and i.to + 100, args=tuple(a + 100 if a > 0 else a for a in i.args))
        for i in once
    ]
    assert 40 - 8 <= allocated([*once, *again], 8).slots < 40


def test_a_far_operand_is_read_where_it_stands() -> None:
    """It would only hold a register; what is wanted soon again is loaded."""
    first, *soon = listing_of(("add", 1, (-1, -2)), ("mul", 2, (1, -2)), ("mul", 3, (2, -1)))
    between = [Instruction("mul", k, (k - 1, k - 1)) for k in range(2, 40)]
    read = []
    for rest in ([*soon, *pages(3)], [*between, *pages(39, -1, -2)]):
        moves = allocated([first, *rest], 8).moves
        read += [{p.kind for p in m.args} for m in moves if m.op == "add"]
    assert read == [{"register"}, {"register", "home"}]


# -- listings ----------------------------------------------------------------------------------


def test_products_join_the_one_sum_that_wants_them() -> None:
    a, b, c, d = -1, -2, -3, -4
    code = listing_of(
        *(("mul", 1, (a, b)), ("add", 2, (c, 1))),  # c + a b
        *(("mul", 3, (a, c)), ("sub", 4, (d, 3))),  # d - a c
        *(("mul", 5, (b, d)), ("sub", 6, (5, a))),  # b d - a
        *(("mul", 7, (c, d)), ("add", 8, (7, a)), ("add", 9, (7, b))),  # wanted twice
        *(("mul", 10, (a, d)), ("add", 11, (10, 10))),
        *(("mul", 12, (a, a)), ("sqrt", 13, (b,))),  # wanted by nobody
        *(("output", None, (v,)) for v in (2, 4, 6, 8, 9, 11)),
    )
    assert contracted(code)[:-6] == listing_of(
        ("fma", 2, (a, b, c)),
        ("fnma", 4, (a, c, d)),
        ("fms", 6, (b, d, a)),
        *(("mul", 7, (c, d)), ("add", 8, (7, a)), ("add", 9, (7, b))),
        *(("mul", 10, (a, d)), ("add", 11, (10, 10))),
    )


def test_zeros_of_either_sign_are_two_literals() -> None:
    listing = Listing()
    assert listing.number(0.0) != listing.number(-0.0)
    assert listing.number(0.0) == listing.bits(0) == listing.number(0.0)
