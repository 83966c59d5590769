"""A graph as C: one evaluation with chains in the lanes, a batch with samples in them."""
