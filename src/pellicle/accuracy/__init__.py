"""Accuracy against time: every method of computing a signal, with its measured error and cost."""
