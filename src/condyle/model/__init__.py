"""Numbers in, numbers out: evaluate, judge samples, the robust path."""
