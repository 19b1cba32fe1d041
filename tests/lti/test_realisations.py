"""Derivatives by everything that a search moves, against differences; bases of lines."""

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.cost.many_starts import many_starts
from freqid.fitting.cost.nuisance import Delay, HoldPeriod
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.lti import sampled_response
from freqid.lti.eigen_basis import EigenBasis
from freqid.lti.polynomials import PolynomialBasis
from freqid.lti.schur_basis import SchurBasis

DT = 0.01
OMEGA = 2 * np.pi * np.linspace(0.5, 45, 40)


def chain(a, b, c):
    """Two inputs, two outputs; three lags in a row, defective where their rates are equal."""
    A = [[-a, 0, 0], [a, -b, 0], [0, b, -c]]
    return A, [[1, 0], [0, 2], [0, 0]], [[0, 0, 1], [1, 0.1 * b / c, 0]], [[0, 0], [0.3 * a / c, 0]]


RATES = {"eigenvalues": {"a": 5.0, "b": 20.0, "c": 60.0}, "blocks": dict.fromkeys("abc", 20.0)}
PLANTS = {
    kind: fq.GreyBox(chain, [fq.Parameter(n, v) for n, v in rates.items()])
    for kind, rates in RATES.items()
}
UNKNOWNS = {
    "plant alone": (),
    "hold": (HoldPeriod(0.4 * DT, DT),),
    "hold of the sample time": (HoldPeriod(DT, DT),),
    "delay": (Delay(0.3 * DT, DT),),
    "delay of samples": (Delay(2.6 * DT, DT),),
}


@pytest.mark.parametrize("hold", [fq.ZeroOrderHold(DT), fq.FirstOrderHold(DT), fq.BandLimited()])
@pytest.mark.parametrize("unknown", UNKNOWNS)
@pytest.mark.parametrize("kind", PLANTS)
def test_derivatives_by_all_unknowns_are_those_of_differences(kind, unknown, hold):
    delayed = unknown.startswith("delay")
    if isinstance(hold, fq.FirstOrderHold) and delayed:
        pytest.skip("a delay needs a zero-order hold or a band-limited input")
    if not isinstance(hold, fq.ZeroOrderHold) and unknown.startswith("hold"):
        pytest.skip("the period is that of a zero-order hold")
    structure = GreyStructure(PLANTS[kind], unknown=UNKNOWNS[unknown])
    x = structure.start

    def response(x):
        return sampled_response(structure.realise(x), OMEGA, hold)

    realisation = structure.realise(x)
    assert isinstance(realisation.basis, EigenBasis if kind == "eigenvalues" else SchurBasis)
    G, dG = response(x)
    for i, size in enumerate(np.eye(len(x))):
        h = 1e-5
        wanted = (response(x + h * size)[0] - response(x - h * size)[0]) / (2 * h)
        np.testing.assert_allclose(dG[i], wanted, atol=1e-7 * np.abs(G).max())
    by = np.linspace(0.5, 3, len(x))
    scaled = sampled_response(realisation.scaled(by), OMEGA, hold)
    np.testing.assert_allclose(scaled[0], G, rtol=1e-14)
    np.testing.assert_allclose(scaled[1], dG * by[:, None, None, None], rtol=1e-12, atol=1e-300)
    assert np.abs(dG).max() > 0
    fewer = sampled_response(realisation.without(0), OMEGA, hold)
    # an unknown that is held keeps the place of none
    if not UNKNOWNS[unknown]:
        np.testing.assert_allclose(fewer[1], dG[1:], rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("late", [0.0, 0.25, 1.0, 1.75, 3.0])
def test_a_late_input_answers_as_a_plant_with_whole_and_broken_samples(kind, late):
    """Against the closed form: exp(−A(1 − f)h) between two holds, by scipy's exponential."""
    from scipy.linalg import expm

    plant = PLANTS[kind]
    A, B, C, D = plant.state_space()
    structure = GreyStructure(plant, unknown=(Delay(late * DT, DT),))
    G, _ = sampled_response(structure.realise(structure.start), OMEGA, fq.ZeroOrderHold(DT))
    q = int(np.ceil(late - 1e-9))
    f = late - q + 1
    n, m = B.shape

    def held(t):
        return expm(np.block([[A * t, B * t], [np.zeros((m, n + m))]]))[:n, n:]

    old, new = expm(A * (1 - f) * DT) @ held(f * DT), held((1 - f) * DT)
    z = np.exp(1j * OMEGA * DT)
    for k, zk in enumerate(z):
        drive = old * zk**-q + new * zk ** (1 - q)
        wanted = C @ np.linalg.solve(zk * np.eye(n) - expm(A * DT), drive) + D * zk**-q
        np.testing.assert_allclose(G[:, :, k], wanted, rtol=1e-10, atol=1e-13)


def test_polynomials_on_lines_are_orthonormal_and_turn_into_one_another(rng):
    """Gram's matrix by itself, the recurrence w·q_k, other points, and roots by numpy."""
    w = np.exp(1j * np.linspace(0.05, 2.9, 90))
    weight = rng.uniform(0.5, 2, 90)
    basis = PolynomialBasis.on(w, weight, 6)
    gram = (basis.Q * weight**2) @ basis.Q.conj().T
    np.testing.assert_allclose(gram.real, np.eye(7), atol=1e-12)
    np.testing.assert_allclose(w * basis.Q[:6], basis.H.T @ basis.Q, atol=1e-10)
    np.testing.assert_allclose(basis.at(w), basis.Q, atol=1e-9)
    a = rng.uniform(-0.5, 0.5, 6)
    roots = basis.roots(a)
    value = a @ basis.at(roots)[:6] + basis.at(roots)[6]
    assert np.abs(value).max() < 1e-8 * np.abs(basis.at(roots)).max()
    np.testing.assert_allclose(basis.denominator(a), a @ basis.Q[:6] + basis.Q[6], rtol=1e-13)


def test_a_sampled_plant_has_as_many_inputs_as_its_columns():
    """Two outputs and one input, and the other way round: none is taken for the other."""
    for inputs, outputs in ((1, 2), (3, 1)):
        A, B = np.diag([-1.0, -2.0, -5.0, -9.0]), np.ones((4, inputs))
        model = fq.GreyBox(
            lambda a, A=A, B=B, p=outputs: (a * A, B, np.ones((p, 4)), np.zeros((p, B.shape[1]))),
            [fq.Parameter("a", 1.0)],
        )
        G = model.frequency_response(OMEGA, fq.ZeroOrderHold(DT)).response
        assert G.shape == (outputs, inputs, len(OMEGA))
        wanted = model.to_control().sample(DT)(np.exp(1j * OMEGA * DT), squeeze=False)
        np.testing.assert_allclose(G, wanted, rtol=1e-9)


def test_plants_of_a_batch_do_not_lose_one_another():
    """One that ran away to 1e14 gave its scale to all others, and left them without a response."""
    model = fq.drivetrain(3)
    structure = GreyStructure(model)
    wild = np.where(np.array(structure.names) == "J2", 3e14, 1.0)
    points = np.array([wild, structure.start, 1.3 * structure.start])
    G, dG = structure.sensitivities(points, OMEGA, fq.ZeroOrderHold(DT))
    for i in (1, 2):
        alone, slopes = sampled_response(structure.realise(points[i]), OMEGA, fq.ZeroOrderHold(DT))
        assert G[i] == pytest.approx(alone, rel=1e-9)
        assert np.abs(dG[i] - slopes).max() <= 1e-8 * np.abs(slopes).max()


def test_a_batch_of_starts_has_the_cost_of_each():
    record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 2, 1e-3), 1e-3).decimate(2)
    record = record.with_noise(0.02 * record.y.std(), seed=1)
    structure = GreyStructure(fq.two_mass())
    experiment = Reading.of(record, "zoh", None).lines()
    objective = Objective(structure, [experiment])
    x = structure.start * np.random.default_rng(1).uniform(0.8, 1.2, (5, len(structure.start)))
    cost, gradient, curvature = many_starts(structure, [experiment], 5).normal(x, np.arange(5))
    for i, row in enumerate(x):
        point = objective.point(row)
        assert cost[i] == pytest.approx(point.cost, rel=1e-9)
        assert gradient[i] == pytest.approx(point.jacobian.T @ point.residual, rel=1e-6)
        assert curvature[i] == pytest.approx(point.jacobian.T @ point.jacobian, rel=1e-6)
