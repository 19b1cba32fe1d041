"""Ready-made plants: the first-order lag and the two-mass axis of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from freqid.checks import Array, InputError, choice, finite, listed, whole
from freqid.models.grey_box import GreyBox
from freqid.models.parameter import Parameter


def first_order(b: float = 100, a: float = 100) -> GreyBox:
    """b / (s + a), the paper's eq. 1: gain b in 1/s, pole at −a rad/s.

    Raises ValueError for values that are not finite.

    >>> first_order().values
    {'b': 100.0, 'a': 100.0}
    """
    return GreyBox(
        _first_order,
        [Parameter("b", b, unit="1/s"), Parameter("a", a, unit="rad/s")],
        name="first order",
        vectorized=True,
    )


def two_mass(
    Jm: float = 9e-4,
    k: float = 1.5e5,
    Ja: float = 11,
    fm: float = 1e-3,
    d: float = 10,
    gear: float = 1 / 118,
) -> GreyBox:
    """Motor and arm joined by a flexible gear: the paper's eq. 9-11 with Table 1's values.

    With the twist φ, the velocities ω of motor and arm and the gear ratio r, which is fixed:
    φ' = r ωm − ωa, Jm ωm' = u − fm ωm − r (k φ + d φ'), Ja ωa' = k φ + d φ'; y = ωm.
    Input: motor torque (N m). Output: motor velocity (rad/s). Jm and Ja are inertias (kg m²), k the
    stiffness (N m/rad), d the damping of the gear and fm the friction of the motor (N m s/rad).
    Raises ValueError for values that are not finite.

    >>> [p.name for p in two_mass().free_parameters]
    ['Jm', 'k', 'Ja', 'fm', 'd']
    """
    return GreyBox(
        _two_mass,
        [
            Parameter("Jm", Jm, unit="kg m²"),
            Parameter("k", k, unit="N m/rad"),
            Parameter("Ja", Ja, unit="kg m²"),
            Parameter("fm", fm, unit="N m s/rad"),
            Parameter("d", d, unit="N m s/rad"),
            Parameter("gear", gear, unit="1", fixed=True),
        ],
        inputs=["torque"],
        outputs=["velocity"],
        name="two-mass",
        vectorized=True,
    )


# masses of a chain: more are a mesh, for which dense matrices are the wrong tool
_LONGEST = 200


def drivetrain(
    n_masses: int,
    outputs: Sequence[str] = ("motor velocity",),
    gear: float = 1 / 118,
    input_delay: float | str | None = None,
    **values: float,
) -> GreyBox:
    """A chain of ``n_masses`` inertias behind a gear, springs and dampers between them.

    The first is the motor, the others parts of the arm: ``two_mass`` with more of them. Input:
    motor torque (N m). ``outputs`` are any of "motor" or "arm" (the last mass) with
    "position" (rad), "velocity" (rad/s) or "acceleration" (rad/s²). Parameters: inertias J1 (motor)
    to Jn in kg m², stiffnesses k1 … in N m/rad and dampings d1 … in N m s/rad of the joints, the
    motor's friction fm in N m s/rad, and the gear ratio, which is fixed; ``values`` replaces the
    defaults. ``input_delay`` is by how much the torque comes late, in s, or the name of one more
    parameter for it, begun from zero. Raises ValueError for fewer than two masses, an unknown
    output or parameter.

    >>> drivetrain(3).free_parameters[-1].name
    'fm'
    """
    n = whole("n_masses", n_masses, least=2)
    if n > _LONGEST:
        raise InputError(f"n_masses={n} must be at most {_LONGEST}")
    names = [outputs] if isinstance(outputs, str) else listed("outputs", outputs)
    if finite("gear", gear) == 0:
        raise InputError("gear=0 joins nothing; expected a ratio other than zero")
    for name in names:
        choice("outputs", name, _DRIVETRAIN_OUTPUTS)
    if not names:
        raise InputError(f"outputs=[] is empty; expected any of {', '.join(_DRIVETRAIN_OUTPUTS)}")
    # the paper's axis, its arm and gear shared out so that the modes lie apart
    parameters = [Parameter("J1", 9e-4, unit="kg m²")]
    parameters += [Parameter(f"J{i}", 22.0 / n / 2 ** (i - 2), "kg m²") for i in range(2, n + 1)]
    parameters += [Parameter(f"k{i}", 1.5e5 * i, "N m/rad") for i in range(1, n)]
    parameters += [Parameter(f"d{i}", 10.0 * i, "N m s/rad") for i in range(1, n)]
    parameters += [Parameter("fm", 1e-3, "N m s/rad"), Parameter("gear", gear, "1", fixed=True)]
    if isinstance(input_delay, str):
        parameters.append(Parameter(input_delay, 0.0, "s"))
    model = GreyBox(
        partial(_drivetrain, n, tuple(names)),
        parameters,
        input_delay=input_delay,
        inputs=["torque"],
        outputs=names,
        name=f"drivetrain of {n} masses",
        vectorized=True,
    )
    return model.with_values(**values)


_DRIVETRAIN_OUTPUTS = tuple(
    f"{mass} {what}"
    for mass in ("motor", "arm")
    for what in ("position", "velocity", "acceleration")
)


def _drivetrain(n: int, outputs: tuple[str, ...], **v: Array) -> tuple[Array, ...]:
    """States: n − 1 twists, n velocities, and a position of each mass whose position is wanted."""
    positions = [mass for mass in ("motor", "arm") if f"{mass} position" in outputs]
    zero = 0 * v["J1"]
    size = 2 * n - 1 + len(positions)
    A = [[zero] * size for _ in range(size)]
    B = [[zero] for _ in range(size)]
    speed = {i: n - 1 + i for i in range(n)}
    # behind the gear the motor turns r times slower
    ratio = [v["gear"] if i == 0 else 1 + zero for i in range(n)]
    A[speed[0]][speed[0]] = -v["fm"] / v["J1"]
    B[speed[0]][0] = 1 / v["J1"]
    for i in range(n - 1):
        A[i][speed[i]], A[i][speed[i + 1]] = ratio[i], zero - 1
        k, d = v[f"k{i + 1}"], v[f"d{i + 1}"]
        for mass, sign, r in ((i, -1, ratio[i]), (i + 1, 1, 1)):
            row, J = A[speed[mass]], v[f"J{mass + 1}"]
            row[i] = row[i] + sign * r * k / J
            row[speed[i]] = row[speed[i]] + sign * r * d * ratio[i] / J
            row[speed[i + 1]] = row[speed[i + 1]] - sign * r * d / J
    last = {"motor": speed[0], "arm": speed[n - 1]}
    for number, place in enumerate(positions):
        A[2 * n - 1 + number][last[place]] = 1 + zero
    C, D = [], []
    for output in outputs:
        place, what = output.split()
        seen, direct = [zero] * size, zero
        if what == "position":
            seen[2 * n - 1 + positions.index(place)] = 1 + zero
        elif what == "velocity":
            seen[last[place]] = 1 + zero
        else:
            seen, direct = A[last[place]], B[last[place]][0]
        C.append(seen)
        D.append([direct])
    return _stack(A), _stack(B), _stack(C), _stack(D)


def _first_order(b: Array, a: Array) -> tuple[Array, ...]:
    return _stack([[-a]]), _stack([[b]]), _stack([[1 + 0 * a]]), _stack([[0 * a]])


def _two_mass(
    Jm: Array, k: Array, Ja: Array, fm: Array, d: Array, gear: Array
) -> tuple[Array, ...]:
    r = gear
    shape, kind = np.shape(k), np.result_type(Jm, k, Ja, fm, d, gear)
    A, B = np.zeros((*shape, 3, 3), kind), np.zeros((*shape, 3, 1), kind)
    A[..., 0, 1], A[..., 0, 2] = r, -1
    A[..., 1, 0], A[..., 1, 1] = -r * k / Jm, -(fm + r**2 * d) / Jm
    A[..., 1, 2], A[..., 2, 0] = r * d / Jm, k / Ja
    A[..., 2, 1], A[..., 2, 2] = d * r / Ja, -d / Ja
    B[..., 1, 0] = 1 / Jm
    C = np.zeros((*shape, 1, 3))
    C[..., 0, 1] = 1
    return A, B, C, np.zeros((*shape, 1, 1))


def _stack(rows: list[list[Array]]) -> Array:
    """A matrix of scalars, or of equally long arrays with their axis moved to the front."""
    matrix: Array = np.array(rows)
    return matrix if matrix.ndim == 2 else np.moveaxis(matrix, (0, 1), (-2, -1))


PLANTS: dict[str, Callable[[], GreyBox]] = {
    "first-order": first_order,
    "two-mass": two_mass,
    "three-mass": partial(drivetrain, 3),
}
