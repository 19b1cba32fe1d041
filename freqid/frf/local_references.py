"""From local models of a reference's effects on inputs and outputs to the plant between them.

G = G_yr G_ur⁻¹, and to first order δG = (δG_yr − G δG_ur) G_ur⁻¹. In a loop the noise of outputs
comes back in the inputs, so that at each line the two go together: what disturbs the plant moves
both, and of what both say of it, only their difference counts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import LineNoise

# errors squared over their variance that are believed, and the part of a sum that is rounding
_CHANCE, _ROUNDING = 4.0, 1e-13


class Values(NamedTuple):
    """What W windows tell at the s lines that each of them serves, one after the other.

    ``response``, ``variance`` and ``share`` of the channels' power that is not noise are (W·s,
    channels, inputs); ``rows`` (W·s, channels, inputs, …, n) are what n lines of the window add to
    the response, and ``noise`` (W, channels, channels) is the covariance of these lines' noise.
    """

    response: ComplexArray
    variance: FloatArray
    share: FloatArray
    rows: ComplexArray
    noise: ComplexArray


def between(answers: Values, m: int) -> Values:
    """Of the plant whose m inputs are the last channels of what answers references.

    Its rows (W·s, outputs, m, 1 + m, n) are those of its output's noise and of all inputs'.
    """
    Z, p = answers.response, answers.response.shape[1] - m
    back = np.linalg.inv(Z[:, p:])
    G = Z[:, :p] @ back
    # each channel's own part of the error of G
    through = np.einsum("kcjn,kji->kcin", answers.rows, back)
    of_inputs = -np.einsum("kol,klin->koiln", G, through[:, p:])
    rows = np.concatenate([through[:, :p, :, None], of_inputs], axis=3)
    noise = np.repeat(_of_outputs(answers.noise, p), len(Z) // len(answers.noise), axis=0)
    spread = np.einsum("koab,koibn->koian", noise, rows.conj())
    apart = np.einsum("koian,koaa->koi", np.abs(rows) ** 2, noise.real)
    # parts that cancel leave rounding
    told = np.maximum(np.einsum("koian,koian->koi", rows, spread).real, _ROUNDING * apart)
    variance = _of_a_ratio(told, apart, through[:, p:], spread[..., 1:, :], noise[:, :, 1:, 1:])
    rows = rows * np.sqrt(variance / np.where(told > 0, told, np.inf))[:, :, :, None, None]
    return Values(G, variance, answers.share[:, :p, :1].repeat(m, axis=-1), rows, answers.noise)


def _of_a_ratio(
    told: FloatArray,
    apart: FloatArray,
    inputs: ComplexArray,
    spread: ComplexArray,
    noise: ComplexArray,
) -> FloatArray:
    """Variance (K, outputs, m) of G = G_yr G_ur⁻¹, which is ``told`` as V to first order, and would
    be ``apart`` were its parts unrelated.

    e = G₀ − G is (δG_yr − G₀ δG_ur) G_ur⁻¹ without any order left out, so that with the relative
    error h of an input |e|² is no more than c (V + 2|e cov(δG, h)| + |e|² var h), with the chance
    that c is for (Fieller, J. Royal Statistical Society B 16, 1954). First orders believe a line
    of which the loop's own noise makes −1/K, for there they leave nothing.
    """
    relative = np.einsum("kiin->kin", inputs)
    related = np.abs(np.einsum("koiin,kin->koi", spread, relative))
    own = np.einsum("koii->koi", noise).real
    g = own * (np.abs(relative) ** 2).sum(axis=2)[:, None]
    left = np.maximum(1 - _CHANCE * g, 1e-9)
    edge = _CHANCE * related + np.sqrt((_CHANCE * related) ** 2 + _CHANCE * told * left)
    # where an input is noise any plant will do: no farther than its parts go, were they unrelated
    most = np.maximum(told, apart) * (1 + _CHANCE * g)
    farthest: FloatArray = np.minimum((edge / left) ** 2 / _CHANCE, most)
    return farthest


def related(first: IntArray, rows: ComplexArray, noise: ComplexArray) -> LineNoise:
    """How the noise of lines, of a covariance ``noise`` (lines, channels, channels), gets into a
    response: ``rows`` (K, outputs, inputs, 1 + inputs, E, w) from the lines ``first`` (K,) on.

    It is told as that of so many sources that have nothing to do with one another.
    """
    K, p, m, w = *rows.shape[:3], rows.shape[-1]
    size, turn = np.linalg.eigh(_of_outputs(noise, p))
    sources = turn * np.sqrt(np.maximum(size, 0))[..., None, :]
    at = first[:, None] + np.arange(w)
    told = np.einsum("koiaew,kwoas->koisew", rows, sources[at]).reshape(K, p, m, -1, w)
    return LineNoise(first, told, np.ones((p, len(noise))))


def _of_outputs(noise: ComplexArray, p: int) -> ComplexArray:
    """Each output's covariance with all inputs, (…, p, 1 + m, 1 + m), of that of all channels."""
    inputs = np.arange(p, noise.shape[-1])
    own = np.stack([np.r_[output, inputs] for output in range(p)])
    return noise[..., own[:, :, None], own[:, None, :]]
