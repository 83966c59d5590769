"""Skips are seen: CONDYLE_MAY_SKIP lists, line by line, words of the reasons that are let pass."""

from __future__ import annotations

import os

import pytest

REASONS = os.environ.get("CONDYLE_MAY_SKIP")
unlisted: list[str] = []


def _note(report: pytest.TestReport | pytest.CollectReport) -> None:
    if REASONS is None or not report.skipped or hasattr(report, "wasxfail"):
        return
    said = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    if not any(words in said for words in REASONS.splitlines() if words):
        unlisted.append(f"{report.nodeid}: {said}")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _note(report)


def pytest_collectreport(report: pytest.CollectReport) -> None:
    _note(report)


def pytest_sessionfinish(session: pytest.Session) -> None:
    if unlisted and session.exitstatus == 0 and not hasattr(session.config, "workerinput"):
        session.exitstatus = 1


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if unlisted:
        terminalreporter.section("skipped, and not listed in CONDYLE_MAY_SKIP")
        for one in unlisted:
            terminalreporter.line(one)
