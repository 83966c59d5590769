"""The operations of a question as a graph: read, changed, put in order."""
