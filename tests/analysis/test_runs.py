"""What is timed, and what is not."""

from __future__ import annotations

import gc

import pytest

import condyle
from condyle.analysis.runs import TimedModel, without_collection


def test_no_garbage_is_collected_while_a_model_is_derived() -> None:
    """A collection would be one model's seconds for what all models have left."""
    runs: list[str] = []
    gc.callbacks.append(lambda phase, info: runs.append(phase))
    before = gc.get_threshold()
    gc.set_threshold(10)
    try:
        mechanism = condyle.load("masticatory")
        TimedModel(mechanism, "momentum", "core")
        runs.clear()
        TimedModel(mechanism, "lagrange", "core")
        assert len(runs) <= 4  # between the derivation and this line
    finally:
        gc.set_threshold(*before)
        gc.callbacks.pop()


def test_collection_goes_on_after_an_error() -> None:
    with pytest.raises(ValueError, match="wrong"), without_collection():
        assert not gc.isenabled()
        raise ValueError("wrong")
    assert gc.isenabled()
