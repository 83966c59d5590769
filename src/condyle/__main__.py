"""`python -m condyle`."""

from .cli import main

main()
