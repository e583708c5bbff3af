"""What the bands of a spectrum share of their errors, where the table does not say: a lamp that flickers."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.likelihood import log_evidence, profile
from lightfield.diagnosis.problem.layout import Labels
from lightfield.diagnosis.problem.quoted import OWN_PART

#: Shares that are tried, from none to so many times the whole error of the brightest reading. Chosen.
_SHARES, _MOST = 16, 1.5
#: By how much the log evidence must grow. Chosen: two standard deviations. Of 40 tables of five bands, with a
#: flicker of 0.6 % in errors of 0.7 %, it was told in 35, and without one in none (at 1 in 35 and 4).
_EVIDENT = 2.0


def shared_part(
    residual: Array, rich: Array, keep: Array, spectrum: Labels, relative: Array, known: Array, stated: bool
) -> float:
    """Standard error over the reading that bands of one spectrum share, as a part of the whole errors; 0
    without evidence.

    By the restricted likelihood beside all that a model can move. No larger than the errors allow: what more
    the bands have in common is a finding.

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened by the whole errors.
    rich : array, shape (n, k)
        Whitened likewise.
    spectrum : array of int, shape (n,)
        Which readings are of one spectrum.
    relative : array, shape (n,)
        Reading over its error.
    known : array, shape (n,)
        What they are known to share over the error, as of a place that is off.
    stated : bool
        Are the errors stated? Else their scale is free.
    """
    kept = keep > 0
    of = np.unique(spectrum[kept], return_inverse=True)[1]
    bright, known = relative[kept], known[kept]
    if of.max(initial=-1) + 1 == len(of) or not bright.any():
        return 0.0
    rows, expected = np.column_stack([rich, residual])[kept], 1.0 if stated else None
    shares = np.linspace(0.0, _MOST, _SHARES) / bright.max()
    evidence = np.empty(_SHARES)
    for k, share in enumerate(shares):
        white, log_root = _apart(rows, of, share * bright, known)
        evidence[k] = log_evidence(white, expected) - log_root
    best = int(evidence.argmax())
    if evidence[best] - evidence[0] <= _EVIDENT:
        return 0.0
    if stated:
        return float(shares[best])
    variance = profile(_apart(rows, of, shares[best] * bright, known)[0])[1]
    return float(shares[best] * np.sqrt(min(variance, 1.0)))


def _apart(rows: Array, of: Labels, part: Array, known: Array) -> tuple[Array, float]:
    """Rows whitened of which those of one label share a part of their unit variance, and what is known
    besides; half the log determinant of their covariance.

    The own part of a variance is what is left of it, see `own_part`. Both go with the light within a label.
    """
    root = np.sqrt(np.maximum(1 - part**2, OWN_PART**2))
    own, along = rows / root[:, None], np.hypot(part, known) / root
    size = np.bincount(of, along**2)
    taken = np.divide(1 - 1 / np.sqrt(1 + size), size, out=np.zeros_like(size), where=size > 0)
    together = np.stack([np.bincount(of, along * column) for column in own.T], axis=1)
    white = own - along[:, None] * (taken[:, None] * together)[of]
    return white, float(np.log(root).sum() + 0.5 * np.log1p(size).sum())
