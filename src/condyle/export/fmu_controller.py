"""A scenario's controller as an FMU: its ticks, with their states and watchdog, in co-simulation.

One step is one tick, with the inputs where the step begins. `fmi_controller.c` stands between the
exported controller and `fmi.c`; variables and parameters are those of its C.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .catalogue import READ
from .controller import ControllerSource
from .controller_settings import Setting
from .controller_states import CAUSES, INPUTS, STATES
from .exported import CArray
from .fmu_model import CODES, Fmu, Variables, assembled, takes
from .syntax import filled, literal, packaged

NEVER = 1e300  # of a trip that is off: not all hosts read infinity
RUN = 3.0
FLAGS = ("inhibit", "drive_fault", "e_stop")
FOLLOW = "1: the scenario's path, from the first tick on; 0: q_d, q1_d, q2_d and force_d"
HOST = "1: the host gives efforts to the plant a step late; the scenario's delay includes it"
FOLLOWED = "independent coordinates that the law was asked for"


def controller_fmu(source: ControllerSource) -> Fmu:
    """The controller of a scenario."""
    e, drive, path = source.exported, source.drive, np.array([*source.in_time.reference.values()])
    tick = {a.name: a for a in e["tick"].arguments}
    law = [a.name for a in e["tick"].inputs]
    joint, q, q1 = tick["joint"], *e["joints"].inputs
    variables = Variables(e.names)
    places, add, scalar = variables.places, variables.add, variables.add_scalar

    def like(a: CArray, name: str, text: str, *units: str) -> CArray:
        """An array with the labels of another, and its units."""
        return CArray(name, text, a.labels, units * a.size or a.units, True)

    add("input", like(joint, "reading", READ["joint"][0]))
    for name in ("joint_rate", "force"):
        if name in law:
            add("input", tick[name])
    marks = source.plan.scenario.safety.search is not None
    for name in ("lost", *("index",) * marks):
        add("input", like(joint, name, f"not 0: {INPUTS[name]}", "1"))
    for name in FLAGS:
        scalar("input", name, "1", f"not 0: {INPUTS[name]}", 0.0)
    scalar("input", "wanted", "1", "0 off, 2 hold, 3 run, 4 a safe stop", RUN)
    q2 = [f"{unit}/s^2" for unit in q.units]
    for name, text, units, start in zip(
        ("q_d", "q1_d", "q2_d"),
        ("independent coordinates", "rates of q", "accelerations of q"),
        (q.units, q1.units, q2),
        np.split(path[1:-1, 0], 3),
        strict=True,
    ):
        add("input", CArray(name, f"desired {text}", q.labels, tuple(units), True), start)
    scalar("input", "force_d", "N", "force to be held, of laws that hold one", float(path[-1, 0]))

    settings = source.settings[1:]  # the period stays
    for s in settings:
        units = s.units if len(s.units) == len(s.labels) else s.units[:1] * max(1, len(s.labels))
        if not s.labels and len({*s.units}) > 1:
            units = ("1",)
        own = CArray(s.name, s.text, s.labels or (s.name,), units, True)
        add("parameter", own, np.minimum(s.values, NEVER))
    scalar("parameter", "follow_path", "1", FOLLOW, 1.0)
    scalar("parameter", "host_delay", "1", HOST, 0.0)
    add("fixed", like(q, "q_start", "where it begins"), source.plan.q)
    add("fixed", like(q1, "q1_start", "rates where it begins"), source.plan.q1)
    scalar("fixed", "state_start", "1", f"what it begins with: {_numbered(STATES)}", RUN)

    scalar("output", "status", "1", CODES)
    add("output", tick["effort"])
    rows = {"q": tick["q"], "q1": tick["q1"], "followed": like(q, "followed", FOLLOWED)}
    for a in rows.values():
        add("output", a)
    for name, (_, text) in NUMBERS.items():
        scalar("output", name, "1", text)

    period = drive.period or 0.0
    macros = {
        "TICKS": 1,
        "PERIOD": repr(period),
        "PERIOD_TEXT": f'"{period!r}"',
        "DELAY": drive.delay,
    }
    read = {"reading": "joint"} | {name: name for name in ("joint_rate", "force") if name in law}
    flags = [name for name in ("lost", "index") if name in places]
    words = {
        "prefix": e.prefix,
        "PREFIX": e.prefix.upper(),
        "rows": path.shape[1],
        "path": ",\n".join(
            f"    {{{', '.join(literal(float(x), 'double') for x in row)}}}" for row in path[1:].T
        ),
        "settings": "".join(f"    {_set(s, places[s.name])}\n" for s in settings),
        "measure": "".join(
            f"    memcpy(m->{field}, v + {places[name]}, sizeof m->{field});\n"
            for name, field in read.items()
        )
        + "".join(
            f"    for (int i = 0; i < N; i++) m->{name}[i] = v[{places[name]} + i] != 0.0;\n"
            for name in flags
        )
        + "".join(f"    m->{name} = v[{places[name]}] != 0.0;\n" for name in FLAGS),
        "acted": "    memcpy(m.acted, of->asked[delay], sizeof m.acted);\n" * ("acted" in law),
        "outputs": "".join(
            f"    memcpy(v + {places[name]}, c->{field}, sizeof c->{field});\n"
            for name, field in (("q", "q"), ("q1", "q1"), ("followed", "follow"))
        )
        + "".join(
            f"    v[{places[name]}] = (double)c->{field};\n"
            for name, field in (("status", "status"), *((n, f) for n, (f, _) in NUMBERS.items()))
        ),
        **places,
    }
    bounds: dict[str, list[int]] = {">= 0.0": [], "> -HUGE_VAL": []}
    for s in settings:
        bound = "> -HUGE_VAL" if s.signed else ">= 0.0"
        bounds[bound] += range(places[s.name], places[s.name] + len(s.values))
    machine = e.mechanism.name
    return assembled(
        e,
        "controller",
        variables,
        macros,
        filled(packaged("fmi_controller.c"), words) + takes(bounds),
        source.texts,
        text=f"{source.plan.scenario.controller.kind} of a scenario, with states and watchdog: "
        f"readings in, efforts out, of {machine}",
        order=0,
        differentiable=False,
        following=frozenset(places),
        period=period,
        duration=source.plan.duration,
    )


def _set(setting: Setting, place: int) -> str:
    """A setting from its parameter, in C."""
    name = setting.name
    if setting.labels:
        return f"memcpy(s->{name}, v + {place}, sizeof s->{name});"
    return f"s->{name} = {f'(int)fmin(v[{place}], 1e9)' if setting.whole else f'v[{place}]'};"


def _numbered(names: Iterable[str]) -> str:
    return ", ".join(f"{i} {name.lower().replace('_', ' ')}" for i, name in enumerate(names))


# Outputs that are numbers -> where they are in C, and what they are.
NUMBERS = {
    "state": ("state", _numbered(STATES)),
    "why": ("why", f"why it stopped: {_numbered(CAUSES)}"),
    "faults": ("faults", "all causes since they were acknowledged: the sum of 2^cause"),
    "active": ("active", "causes of this tick: the sum of 2^cause"),
    "enable": ("enable", "1: the drives are to be enabled"),
    "late_ticks": ("late", "late ticks, less what good ones took away"),
    "lost_ticks": ("lost", "ticks with lost readings, less what good ones took away"),
    "unconverged": ("unconverged", "ticks whose steps did not suffice for the best efforts"),
}
