"""As few frequencies as an integral over a spectrum needs: Gauss panels that split themselves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from freqid.checks import Array, FloatArray

# nodes of a panel; polynomials up to degree 31 are integrated exactly
NODES = 16
_X, _W = np.polynomial.legendre.leggauss(NODES)
# Legendre coefficients of the polynomial through the nodes of a panel
_TO_COEFFICIENTS = (
    np.polynomial.legendre.legvander(_X, NODES - 1).T * _W * (np.arange(NODES)[:, None] + 0.5)
)
# a panel is fine enough when its last coefficients are this small beside the largest value
TOLERANCE = 1e-7
# halvings after which a panel is left as it is: a jump that no edge announced, or a pole on it
_DEEPEST = 40
# panels at the most: a function that is nowhere a polynomial would halve them for ever
_MOST = 512


def panel_nodes(panels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights (panels·16,) of Gauss-Legendre's rule on panels (panels, 2)."""
    half = (panels[:, 1] - panels[:, 0])[:, None] / 2
    middle = panels.mean(axis=1)[:, None]
    return (middle + half * _X).ravel(), (half * _W).ravel()


def unresolved(values: Array) -> Array:
    """How far the polynomials through a panel's nodes are from having converged.

    ``values`` (…, panels·16); returns (…, panels): the size of the last three coefficients.
    """
    grouped = values.reshape(*values.shape[:-1], -1, NODES)
    return np.abs(grouped @ _TO_COEFFICIENTS[-3:].T).max(axis=-1)


def resolved(
    panels: FloatArray, functions: Callable[[FloatArray], Array], tolerance: float = TOLERANCE
) -> FloatArray:
    """Panels split until each function is a polynomial on each, up to ``tolerance``.

    Args: ``panels`` (n, 2); ``functions(x)`` returns values (functions, len(x)). A product of two
    such functions is then integrated by ``panel_nodes`` to about ``tolerance`` squared.

    >>> panels = resolved(np.array([[0.0, 1.0]]), lambda x: np.array([1 / (x**2 + 1e-4)]))
    >>> x, w = panel_nodes(panels)
    >>> bool(np.isclose(w @ (1 / (x**2 + 1e-4)), 100 * np.arctan(100), rtol=1e-12))
    True
    """
    done = np.zeros((0, 2))
    largest: Array = np.zeros(0)
    for _ in range(_DEEPEST):
        values = functions(panel_nodes(panels)[0])
        peak = np.abs(values).max(axis=-1, initial=0)
        largest = peak if len(largest) == 0 else np.maximum(largest, peak)
        scale = np.where(largest > 0, largest, 1)[:, None]
        # what is not finite does not become so on smaller panels
        fine = ~(unresolved(values) > tolerance * scale).any(axis=0)
        done = np.concatenate([done, panels[fine]])
        coarse = panels[~fine]
        if len(coarse) == 0:
            break
        if len(done) + 2 * len(coarse) > _MOST:
            done = np.concatenate([done, coarse])
            break
        middle = coarse.mean(axis=1)
        panels = np.concatenate(
            [np.column_stack([coarse[:, 0], middle]), np.column_stack([middle, coarse[:, 1]])]
        )
    else:
        done = np.concatenate([done, panels])
    return done[np.argsort(done[:, 0])]
