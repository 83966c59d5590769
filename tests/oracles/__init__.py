"""Oracles: the same mechanics computed by other means, straight from the mechanism file.

Nothing here imports condyle. Functions take the raw dictionary of a mechanism's TOML file and one
state at a time: clarity before performance.
"""
