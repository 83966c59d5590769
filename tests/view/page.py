"""The live page as tests see and touch it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.browser import PATIENCE, Tab

HANDLE = (54, 142, 226)  # blue arrow of the drag control
TOP, LEFT = 420, 440  # of the middle of the scene, without the blue rods


def near(pixels: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Which pixels have nearly that colour."""
    return np.abs(pixels - colour).max(axis=-1) < 25


def ready(tab: Tab) -> Tab:
    tab.page.wait_for_selector("[data-level]")
    # The scene's meshes arrive after the panel, and the blue arrow of the handle last.
    tab.picture_where("canvas", lambda pixels: near(pixels, HANDLE).sum() > 20, "the handle")
    return tab


def fill(tab: Tab, label: str, value: float) -> None:
    """Type into the number of a slider."""
    field = tab.page.locator(
        f'xpath=//label[text()="{label}"]'
        '/ancestor::div[.//input[@inputmode="decimal"]][1]//input[@inputmode="decimal"]'
    )
    field.fill(str(value))
    field.press("Enter")


def upload(tab: Tab, button: str, path: Path) -> None:
    with tab.page.expect_file_chooser() as chooser:
        tab.page.get_by_role("button", name=button).click()
    chooser.value.set_files(str(path))


def row(tab: Tab, table: str, name: str) -> list[str]:
    cells = tab.page.locator(f'[data-table="{table}"] tr').filter(has_text=name).locator("td")
    return cells.all_inner_texts()


def wait_for_level(tab: Tab, level: str) -> str:
    status = tab.page.locator(f'[data-level="{level}"]')
    status.wait_for(timeout=PATIENCE)
    return status.inner_text()


def grip(tab: Tab) -> tuple[int, int]:
    """A place on the blue arrow of the drag control."""

    def blue(pixels: np.ndarray) -> np.ndarray:
        return np.argwhere(near(pixels[TOP:, LEFT:560], HANDLE))

    at = blue(tab.picture_where("canvas", lambda p: len(blue(p)) > 20, "the grip"))[0]
    return LEFT + int(at[1]), TOP + int(at[0]) + 10


def drag(tab: Tab, x: int, y: int, down: int, steps: int) -> None:
    """Press at a place and move downwards; a step of the hand is seen before the next one."""
    tab.page.mouse.down()
    for step in range(1, steps + 1):
        tab.page.mouse.move(x, y + down * step)
        tab.page.evaluate("() => new Promise((done) => requestAnimationFrame(done))")
