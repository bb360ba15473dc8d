"""`python -m pellicle`: the `pellicle` command."""

from pellicle.cli import process

process()
