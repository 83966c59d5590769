"""Results: one labelled dataset with units, the files it becomes, and what it has to say."""
