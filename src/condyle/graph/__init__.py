"""The operations of a question as a graph: reading, transforming, fusing, scheduling."""
