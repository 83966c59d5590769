"""Commands with their answers, and tables read back."""

import csv
import json
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import typer.main

from condyle.cli.answer import Answer, plain

command_line = cache(typer.main.get_command)


@pytest.fixture(scope="module", autouse=True)
def parsed_once() -> Iterator[None]:
    """The parser of all commands' words serves every call."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", command_line)
        # Click names the program by it: under `python -m pytest` that is not the command.
        patch.setattr(sys.modules["__main__"], "__package__", None)
        yield


@pytest.fixture
def run(condyle_command: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs a command in an empty folder: status, out, err; its answer, and data, as --json has it.

    What --json prints is asked of every command in test_answers.
    """
    answers: list[Answer] = []
    give = Answer.give

    def keep(answer: Answer, *how: bool, **names: bool) -> None:
        answers.append(answer)
        give(answer, *how, **names)

    def run(*words: object) -> SimpleNamespace:
        answers.clear()
        outcome = condyle_command(*words)
        answer = answers[0] if answers else None
        data = json.loads(json.dumps(plain(answer.data))) if answer else None
        return SimpleNamespace(**vars(outcome), answer=answer, data=data)

    monkeypatch.setattr(Answer, "give", keep)
    return run


@pytest.fixture
def refused(run: Any) -> Any:
    """Runs what is refused: says so on stderr alone, status 2, and no file is new or changed."""

    def refused(*words: object, said: str) -> str:
        before = {path: path.stat().st_size for path in Path().rglob("*")}
        outcome = run(*words)
        assert outcome.status == 2 and said in outcome.err, (words, outcome.err)
        assert outcome.out == "" and "Traceback" not in outcome.err, words
        assert {path: path.stat().st_size for path in Path().rglob("*")} == before, words
        return outcome.err

    return refused


def write_csv(name: str, header: Any, rows: Any) -> str:
    """Columns with all digits."""
    lines = [header, *np.asarray(rows).tolist()]
    with open(name, "w", newline="") as file:
        csv.writer(file).writerows(lines)
    return name


def read_csv(name: str) -> tuple[list[str], list[list[str]]]:
    """Column names and cells."""
    header, *rows = csv.reader(Path(name).read_text().splitlines())
    return header, rows
