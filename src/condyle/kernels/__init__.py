"""Expressions to fast code: interpreted, one evaluation, batches; cache."""
