"""Every kind of signal by its word. A new one is one module, one line here, and its tests."""

from collections.abc import Sequence
from typing import Any

from pellicle.errors import UsageError
from pellicle.signals.base import Signal
from pellicle.signals.contrast import Contrast
from pellicle.signals.generalised import Generalised
from pellicle.signals.mueller import Mueller
from pellicle.signals.one_column import Counts, OneColumn, Reflectance, Transmittance
from pellicle.signals.psi_delta import PsiDelta

KINDS: dict[str, type[Signal]] = {
    kind.word: kind for kind in (Reflectance, Transmittance, PsiDelta, Mueller, Generalised, Contrast, Counts)
}
"""Kinds of signals by their words, in the order in which messages list them."""
SIGNALS = tuple(KINDS)
"""Words of all signals of a spectrum."""
KEYWORDS = tuple(dict.fromkeys(name for kind in KINDS.values() for name in sorted(kind.keywords)))
"""Arguments of `pellicle.Spectrum` that go with some kinds only."""
ONE_COLUMN = tuple(word for word, kind in KINDS.items() if issubclass(kind, OneColumn) and kind.simulated)
"""Words of the signals of one column."""
SIMULATED = tuple(word for word, kind in KINDS.items() if kind.simulated)
"""Words of the signals that a scene has."""


def kind(word: str, **variant: Any) -> Signal:
    """Return the kind of a signal by its word, and its variant as keywords of the class.

    >>> kind("psi-delta", folded=True).noun
    'psi and delta'
    """
    return KINDS[word](**variant)


def of_light(word: str, transmission: bool = False) -> Signal:
    """Return the kind of the signal of a light. Raises UsageError where it has no `transmission`."""
    if not transmission:
        return KINDS[word]()
    if "transmission" not in KINDS[word].keywords:
        raise UsageError(f'`transmission` goes with `signal="psi-delta"`, not {word!r}: leave it out')
    return KINDS[word](transmission=True)  # pyright: ignore[reportCallIssue]


def of_parts(parts: Sequence[str], word: str | None = None) -> Signal:
    """Return the kind that has these elements or ratios, of this word if one is given.

    Raises UsageError where none has them.
    """
    if word is None:
        word = "generalised-psi-delta" if set(parts) & set(Generalised().parts) else "mueller"
    kind = KINDS[word]
    if not kind().parts:
        raise UsageError('`elements` go with `signal="mueller"`: leave them out')
    return kind().chosen(parts)
