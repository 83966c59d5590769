"""condyle new: copies of bundled machines, and the list of what there is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.export.new_study import study_kinds
from condyle.mechanism import bundled_text


@pytest.mark.parametrize(
    ("word", "machine"),
    [("hexaglide", "hexaglide"), ("jaw", "human-jaw"), ("cable", "cable-robot")],
)
def test_a_bundled_machine_is_copied_with_its_comments(
    condyle_command: Callable[..., Any], word: str, machine: str
) -> None:
    assert condyle_command("new", "mine", "--from", word).status == 0
    made, source = Path("mine.toml").read_text(), bundled_text(machine)
    assert made == source.replace(f'\nname = "{machine}"\n', '\nname = "mine"\n') != source
    assert condyle.load_mechanism("mine.toml").chains == condyle.load_mechanism(machine).chains


def test_the_list_has_a_line_for_each(condyle_command: Callable[..., Any]) -> None:
    found = json.loads(condyle_command("new", "--list", "--json").out)
    assert tuple(found["mechanisms"]) == condyle.bundled_mechanisms()
    assert tuple(found["studies"]) == study_kinds()
    for line in [*found["mechanisms"].values(), *found["studies"].values()]:
        assert 10 < len(line) < 125 and "NAME" not in line
    assert condyle_command("new", "--list").out.count("\n") == 3 + len(
        [*found["mechanisms"], *found["studies"]]
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("x", "--from", "hexaglyde"), 'Did you mean "hexaglide"'),
        (("x", "--from", "jaw", "--study", "fit"), "--from and --study each say"),
        (("x", "--from", "jaw", "--from-mjcf", "a.xml"), "--from and --from-mjcf each say"),
        (("x", "--list"), "--list writes no file"),
        ((), "needs a name"),
    ],
)
def test_what_is_wrong_is_said_and_nothing_written(
    condyle_command: Callable[..., Any], words: tuple[str, ...], said: str
) -> None:
    outcome = condyle_command("new", *words)
    assert outcome.status == 2 and said in outcome.err
    assert not Path("x.toml").exists()


def test_help_names_every_kind_of_study(condyle_command: Callable[..., Any]) -> None:
    shown = condyle_command("new", "--help").out
    assert all(kind in shown for kind in study_kinds())
