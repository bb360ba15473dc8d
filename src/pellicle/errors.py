"""Errors that a user can act on: each message is one sentence with the remedy in it."""

from __future__ import annotations


class DataError(ValueError):
    """Unreadable or impossible data or recipe; the command line ends with exit code 3."""


class UsageError(ValueError):
    """An argument that is missing, contradictory or out of range; exit code 2."""
