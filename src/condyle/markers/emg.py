"""Muscles' activity from EMG: rectified, filtered, and normalised to the greatest."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..errors import InputError, did_you_mean, join, short
from .marker_file import Emg, MarkerFile
from .recorded_tables import read_recording
from .recording import Recording, find_label, has_label

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism

_ORDER = 2  # of each filter, run forwards and backwards: no lag, fourth order in all
_SHORTEST = 3  # periods of a filter that a recording must last
_FEWEST = 20  # samples
_ABOVE = 1.05  # of the greatest, beyond which that was not the greatest

F = TypeVar("F", bound=MarkerFile)


def with_mvc(file: F, subject: str = "") -> F:
    """The file with `greatest` of every chain: as stated, or that of the `mvc` recordings, of a
    subject where they are by subject, a period of the low pass from their ends.

    Raises: InputError: for recordings that cannot be read, and channels that none of them has.
    """
    if file.emg is None or not file.emg.mvc:
        return file
    table, greatest = file.emg, dict(file.emg.greatest)
    recordings = [read_recording(path, markers=False) for path in table.mvc_of(subject)]
    for chain, channel in table.channels.items():
        if chain not in greatest:
            of = [mvc for mvc in recordings if has_label(channel, mvc.channels)] or recordings[:1]
            # Within a period of the low pass from its ends an envelope is up to 7 % too large.
            greatest[chain] = max(
                _greatest(table, mvc, chain, channel, round(mvc.rate / table.low_pass))
                for mvc in of
            )
    update = {"emg": table.model_copy(update={"greatest": greatest})}
    return file.model_copy(update=update)


def above_greatest(table: Emg | None, emg: dict[str, np.ndarray]) -> list[str]:
    """A warning of envelopes that are above the greatest that was given."""
    above = [
        f"{chain} ({values.max():.3g})"
        for chain, values in emg.items()
        if table is not None and chain in table.greatest and values.max() > _ABOVE
    ]
    if not above:
        return []
    return [
        f"emg: more than the greatest (mvc, greatest), which is 1: {join(above)}. The contraction "
        "was not maximal, or its unit or filters are others"
    ]


def envelopes(table: Emg, recording: Recording, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Envelope of each chain named at the frames, (F,), 1 at its greatest.

        |high pass of the signal|, low pass, over the greatest

    The greatest is the one stated, in the channel's unit, or that of maximal contractions
    (`with_mvc`), else the recording's own.

    Raises: InputError: for chains or channels that are not there, rates that are too low, and
            channels that hold nothing.
    """
    by_chain = {}
    for chain, channel in table.channels.items():
        if chain not in mechanism.chain_names:
            known = did_you_mean(chain, mechanism.chain_names)
            raise InputError(f'emg: "{mechanism.name}" has no chain "{chain}".{known}')
        greatest = table.greatest.get(chain) or _greatest(table, recording, chain, channel)
        by_chain[chain] = _envelope(table, recording, channel) / greatest
    return by_chain


def _greatest(table: Emg, recording: Recording, chain: str, channel: str, edge: int = 0) -> float:
    """The largest of a channel's envelope, in its unit, so many frames from its ends."""
    envelope = _envelope(table, recording, channel)
    if greatest := float(envelope[edge : len(envelope) - edge].max(initial=0.0)):
        return greatest
    raise InputError(
        f'{recording.source}: emg: channel "{short(channel)}" ({chain}) is constant; there is '
        "nothing in it"
    )


def _envelope(table: Emg, recording: Recording, channel: str) -> np.ndarray:
    """Envelope of a channel at the frames, (F,), in its unit."""
    from scipy.signal import butter, sosfiltfilt

    at = find_label(channel, recording.channels, f"{recording.source}: emg", "channel")
    signal, rate = recording.samples[..., at].ravel(), recording.channel_rate
    where = f'{recording.source}: emg: channel "{short(recording.channels[at])}"'
    if not np.isfinite(signal).all():
        raise InputError(f"{where} has samples that are no numbers")
    for name, cutoff in (("high_pass", table.high_pass), ("low_pass", table.low_pass)):
        if cutoff >= rate / 2:
            other = ", or 0 for an envelope that is made already" if name == "high_pass" else ""
            raise InputError(
                f"{where} is sampled at {rate:g} Hz, and {name} is {cutoff:g} Hz; expected less "
                f"than {rate / 2:g} Hz{other}"
            )
        needed = max(_SHORTEST * rate / cutoff, _FEWEST) / rate if cutoff else 0.0
        if len(signal) / rate < needed:
            raise InputError(
                f"{where} lasts {len(signal) / rate:.3g} s, too short for {name} = {cutoff:g} Hz; "
                f"expected {needed:.3g} s or more"
            )
    steady = signal - signal.mean() if table.high_pass else signal
    scale = np.abs(steady).max()
    if scale <= 1e-12 * np.abs(signal).max(initial=0.0) or not scale:
        return np.zeros(len(recording.t))
    if table.high_pass:
        steady = sosfiltfilt(butter(_ORDER, table.high_pass, "high", fs=rate, output="sos"), steady)
    smooth = sosfiltfilt(butter(_ORDER, table.low_pass, fs=rate, output="sos"), np.abs(steady))
    # The first sample of a frame is at its time.
    return np.maximum(smooth.reshape(len(recording.t), -1)[:, 0], 0.0)
