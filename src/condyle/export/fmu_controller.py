"""A scenario's controller as an FMU: its ticks, with their states and watchdog, in co-simulation.

One step is one tick, with the inputs where the step begins. `fmi_controller.c` stands between the
exported controller and `fmi.c`; variables and parameters are those of its C.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

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
    e, period = source.exported, source.drive.period or 0.0
    path = np.array([*source.in_time.reference.values()])[1:]
    variables = _variables(source, path[:, 0])
    macros = {
        "TICKS": 1,
        "PERIOD": repr(period),
        "PERIOD_TEXT": f'"{period!r}"',
        "DELAY": source.drive.delay,
    }
    bounds: dict[str, list[int]] = {">= 0.0": [], "> -HUGE_VAL": []}
    for s in source.settings[1:]:
        first = variables.places[s.name]
        bounds["> -HUGE_VAL" if s.signed else ">= 0.0"] += range(first, first + len(s.values))
    code = filled(packaged("fmi_controller.c"), _words(source, variables.places, path))
    law = source.plan.scenario.controller.kind
    return assembled(
        e,
        "controller",
        variables,
        macros,
        code + takes(bounds),
        source.texts,
        text=f"{law} of a scenario, with states and watchdog: readings in, efforts out, of "
        f"{e.mechanism.name}",
        order=0,
        differentiable=False,
        following=frozenset(variables.places),
        period=period,
        duration=source.plan.duration,
    )


def _variables(source: ControllerSource, begins: np.ndarray) -> Variables:
    """All of them. Args: begins: the first row of the path, q, q', q'' and the force."""
    e, safety = source.exported, source.plan.scenario.safety
    tick = {a.name: a for a in e["tick"].arguments}
    joint, q, q1 = tick["joint"], *e["joints"].inputs
    variables = Variables(e.names)
    add, scalar = variables.add, variables.add_scalar

    def like(a: CArray, name: str, text: str, *units: str) -> CArray:
        """An array with the labels of another; units: its own where none are given."""
        units = units * a.size if len(units) == 1 else units or a.units
        return CArray(name, text, a.labels, units, True)

    add("input", like(joint, "reading", READ["joint"][0]))
    for name in _measured(source):
        add("input", tick[name])
    for name in ("lost", *("index",) * (safety.search is not None)):
        add("input", like(joint, name, f"not 0: {INPUTS[name]}", "1"))
    for name in FLAGS:
        scalar("input", name, "1", f"not 0: {INPUTS[name]}", 0.0)
    scalar("input", "wanted", "1", "0 off, 2 hold, 3 run, 4 a safe stop", RUN)
    desired = (
        like(q, "q_d", "desired independent coordinates"),
        like(q, "q1_d", "desired rates of q", *q1.units),
        like(q, "q2_d", "desired accelerations of q", *(f"{unit}/s^2" for unit in q.units)),
    )
    for a, start in zip(desired, np.split(begins[:-1], 3), strict=True):
        add("input", a, start)
    scalar("input", "force_d", "N", "force to be held, of laws that hold one", float(begins[-1]))

    for s in source.settings[1:]:  # the period stays
        alike = s.units if len(set(s.units)) == 1 or s.labels else ("1",)
        labels = s.labels or (s.name,)
        units = alike if len(alike) == len(labels) else alike[:1] * len(labels)
        add("parameter", CArray(s.name, s.text, labels, units, True), np.minimum(s.values, NEVER))
    scalar("parameter", "follow_path", "1", FOLLOW, 1.0)
    scalar("parameter", "host_delay", "1", HOST, 0.0)
    add("fixed", like(q, "q_start", "where it begins"), source.plan.q)
    add("fixed", like(q1, "q1_start", "rates where it begins"), source.plan.q1)
    scalar("fixed", "state_start", "1", f"what it begins with: {_numbered(STATES)}", RUN)

    scalar("output", "status", "1", CODES)
    for a in (tick["effort"], tick["q"], tick["q1"], like(q, "followed", FOLLOWED)):
        add("output", a)
    for name, (_, text) in NUMBERS.items():
        scalar("output", name, "1", text)
    return variables


def _measured(source: ControllerSource) -> list[str]:
    """What the law takes besides readings."""
    law = {a.name for a in source.exported["tick"].inputs}
    return [name for name in ("joint_rate", "force") if name in law]


def _words(
    source: ControllerSource, places: Mapping[str, int], path: np.ndarray
) -> dict[str, object]:
    """What the template takes."""
    e = source.exported
    copied = {"reading": "joint", **{name: name for name in _measured(source)}}
    measure = [
        f"memcpy(m->{to}, v + {places[name]}, sizeof m->{to});" for name, to in copied.items()
    ]
    measure += [
        f"for (int i = 0; i < N; i++) m->{name}[i] = v[{places[name]} + i] != 0.0;"
        for name in ("lost", "index")
        if name in places
    ]
    measure += [f"m->{name} = v[{places[name]}] != 0.0;" for name in FLAGS]
    outputs = [
        f"memcpy(v + {places[name]}, c->{own}, sizeof c->{own});"
        for name, own in {"q": "q", "q1": "q1", "followed": "follow"}.items()
    ]
    outputs += [f"v[{places[name]}] = (double)c->{own};" for name, (own, _) in NUMBERS.items()]
    outputs.append(f"v[{places['status']}] = (double)c->status;")
    acted = any(a.name == "acted" for a in e["tick"].inputs)
    rows = [", ".join(literal(float(x), "double") for x in row) for row in path.T]
    return {
        "prefix": e.prefix,
        "PREFIX": e.prefix.upper(),
        "rows": len(rows),
        "path": ",\n".join(f"    {{{row}}}" for row in rows),
        "settings": _indented(_set(s, places[s.name]) for s in source.settings[1:]),
        "measure": _indented(measure),
        "acted": _indented(["memcpy(m.acted, of->asked[delay], sizeof m.acted);"] * acted),
        "outputs": _indented(outputs),
        **places,
    }


def _indented(lines: Iterable[str]) -> str:
    return "".join(f"    {line}\n" for line in lines)


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
