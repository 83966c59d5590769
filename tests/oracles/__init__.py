"""Oracles: the same mechanics computed by other means, straight from the mechanism file.

Nothing here imports condyle, nor what does (`test_oracles.py` checks it). Functions take the raw
dictionary of a mechanism's TOML file and one state at a time: clarity before performance.
"""
