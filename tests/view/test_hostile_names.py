"""Names and files of strangers on every page: what they say is read, and none of it runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.browser import Tab

import condyle
from condyle.markers import MeasuredChannels
from condyle.motion import Load, Motion
from condyle.view import open_view

from .page import upload

pytestmark = pytest.mark.ci
# `ran` is defined nowhere: where one of these runs, the page complains.
HOSTILE = (
    "<img src=//e.test/a onerror=ran(1)>",
    "</script><script>ran(2)</script>",
    "'><svg onload=ran(3)>",
    "{{ran(4)}}${ran(4)}",
    "<a href=javascript:ran(5)>x</a>",
    "<iframe srcdoc='<script>ran(6)</script>'>",
    "--><style>@import '//e.test/b'</style>",
    "</title><script>ran(7)</script>",
)
T = np.linspace(0.0, 1.0, 11)
LINKS = "a[href^='javascript'], [onerror], [onload], [src*='e.test']"


def hostile_solution() -> Any:
    """Of the human jaw: one sample is out of reach, so that a cause names a muscle."""
    machine = condyle.load_mechanism("human-jaw")

    def named(parts: Sequence[Any]) -> tuple[Any, ...]:
        names = [f"{HOSTILE[i % len(HOSTILE)]}{i // len(HOSTILE)}" for i in range(len(parts))]
        return tuple(p.model_copy(update={"name": n}) for p, n in zip(parts, names, strict=True))

    points = machine.platform.points | {name: (0.01, 0.0, 0.0) for name in HOSTILE}
    platform = machine.platform.model_copy(update={"points": points})
    hostile = machine.replace(
        name=HOSTILE[0],
        chains=named(machine.chains),
        contacts=named(machine.contacts),
        ligaments=named(machine.ligaments),
        walls=named(machine.walls),
        platform=platform,
    )
    model = condyle.derive(hostile, backend="numpy")
    path = {name: np.where(T == 1.0, 0.5, 0.0) * (name == "X") for name in model.independent}
    motion = Motion.from_arrays(T, path, source=HOSTILE[1])
    solution = model.solve(motion, Load.constant((0, 0, -9), point=HOSTILE[2]), flag=True)
    places, residual = np.zeros((len(T), 8, 3)), np.zeros((len(T), 8))
    emg = {str(solution["chain"].values[0]): T}
    bodies = ("fixed", "platform") * 4
    return solution.condyle.with_measured(
        MeasuredChannels(T, HOSTILE, bodies, places, residual, emg)
    )


def look(tab: Tab, url: str) -> None:
    """No name has become an element or asks the network; `open_tab` looks at complaints."""
    assert tab.page.locator(LINKS).count() == 0
    local = (url, "http://127.0.0.1", "ws://127.0.0.1", "data:", "blob:")
    assert [request for request in tab.requests if not request.startswith(local)] == []
    assert "ran(" in tab.page.inner_text("body") or tab.page.locator("canvas").count()


def test_nothing_runs(open_tab: Callable[..., Tab], tmp_path: Path) -> None:
    solution = hostile_solution()
    file = tmp_path / "<img src=x onerror=ran(8)>.toml"
    file.write_text(condyle.dumps(solution.condyle.mechanism), encoding="utf-8")
    condyle.write_report(solution, tmp_path / "report.html", files=[file])
    scene = condyle.moving_scene(solution, fps=5)
    scene.save(tmp_path / "scene.html")
    machine = solution.condyle.mechanism
    shown = (machine, condyle.derive(machine, backend="numpy"), solution.condyle, scene)
    cells = "".join(one._repr_html_() for one in shown)
    (tmp_path / "cells.html").write_text(f"<meta charset=utf-8>{cells}", encoding="utf-8")
    waits = {"report": "html[data-ready=true]", "scene": "canvas", "cells": "iframe"}
    for name, selector in waits.items():
        url = (tmp_path / f"{name}.html").as_uri()
        tab = open_tab(url)
        tab.page.wait_for_selector(selector, state="attached")
        look(tab, url)
    view = open_view(solution=solution, port=0)
    try:
        tab = open_tab(view.url)
        tab.page.wait_for_selector("[data-level]")
        look(tab, view.url)
        send(tab, file)
        tab.until(lambda: view.playback is None, "the mechanism is open")
        file.write_text("x = [", encoding="utf-8")
        send(tab, file)
        tab.page.get_by_text(f"{file.name} is not TOML").wait_for()
        look(tab, view.url)
    finally:
        view.close()


def send(tab: Tab, file: Path) -> None:
    tab.page.get_by_role("tab", name="Open").click()
    upload(tab, "Open a mechanism (.toml)", file)
