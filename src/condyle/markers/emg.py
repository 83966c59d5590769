"""Muscles' activity from EMG: rectified, filtered, and normalised to the greatest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, did_you_mean, short
from .marker_file import Emg
from .recording import Recording, find_label

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism

_ORDER = 2  # of each filter, run forwards and backwards: no lag, fourth order in all
_SHORTEST = 3  # periods of a filter that a recording must last
_FEWEST = 20  # samples


def envelopes(table: Emg, recording: Recording, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Envelope of each chain named at the frames, (F,), 1 at its greatest.

        |high pass of the signal|, low pass, over the greatest

    The greatest is the one stated, in the channel's unit, or the recording's own.

    Raises: InputError: for chains or channels that are not there, rates that are too low, and
            channels that hold nothing.
    """
    found = {}
    for chain, channel in table.channels.items():
        if chain not in mechanism.chain_names:
            known = did_you_mean(chain, mechanism.chain_names)
            raise InputError(f'emg: "{mechanism.name}" has no chain "{chain}".{known}')
        at = find_label(channel, recording.channels, f"{recording.source}: emg", "channel")
        envelope = _envelope(table, recording, at)
        greatest = table.greatest.get(chain) or float(envelope.max(initial=0.0))
        if not greatest:
            raise InputError(
                f'{recording.source}: emg: channel "{short(channel)}" ({chain}) is constant; there '
                "is nothing in it"
            )
        found[chain] = envelope / greatest
    return found


def _envelope(table: Emg, recording: Recording, at: int) -> np.ndarray:
    """Envelope of a channel at the frames, (F,), in its unit."""
    from scipy.signal import butter, sosfiltfilt

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
