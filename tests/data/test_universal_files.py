"""Responses in universal files and MATLAB's: units, several channels, and what does not fit."""

import numpy as np
import pytest
import scipy.io

import freqid as fq

F = np.arange(1.0, 9.0)
G = 1 / (1 + 0.1j * F)


def written(path, *sets):
    pyuff = pytest.importorskip("pyuff")
    made = []
    for one in sets:
        more = {"func_type": 4, "x": F, "data": G, "rsp_node": 1, "ref_node": 7, **one}
        made.append(pyuff.prepare_58(
            rsp_dir=3, ref_dir=3, id1="frf", rsp_ent_name="a", ref_ent_name="b", binary=0,
            abscissa_spacing=0, ordinate_spec_data_type=20, orddenom_spec_data_type=13, **more,
        ))  # fmt: skip
    pyuff.UFF(str(path)).write_sets(made, "overwrite")
    return path


def test_units_are_those_of_the_channels(tmp_path):
    units = {"ordinate_axis_units_lab": "m/s", "orddenom_axis_units_lab": "N"}
    frf = fq.read_response(written(tmp_path / "a.uff", units))
    assert frf.units == {"1:3": "m/s", "7:3": "N"}
    np.testing.assert_allclose(frf.frequency, F)
    np.testing.assert_allclose(frf.response[0, 0], G, rtol=1e-5)


def test_several_responses_are_one_matrix(tmp_path):
    pairs = [(o, i) for o in (1, 2) for i in (7, 8)]
    sets = [{"rsp_node": o, "ref_node": i, "data": (o + 0.1 * i) * G} for o, i in pairs]
    frf = fq.read_response(written(tmp_path / "a.uff", *sets))
    assert frf.response.shape == (2, 2, 8)
    for k, (o, i) in enumerate(pairs):
        np.testing.assert_allclose(frf.response[k // 2, k % 2], (o + 0.1 * i) * G, rtol=1e-5)


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ([{"func_type": 1, "data": G.real}], "holds no frequency responses"),
        ([{}, {"rsp_node": 2, "x": 2 * F}], "unlike frequencies"),
        ([{}, {"rsp_node": 2, "ref_node": 8}], r"holds 2 responses, not all of .*'1:3', '2:3'"),
    ],
    ids=["none", "unlike", "gaps"],
)
def test_what_makes_no_matrix_is_refused_by_name(tmp_path, sets, words):
    with pytest.raises(ValueError, match=rf"a\.uff.*{words}"):
        fq.read_response(written(tmp_path / "a.uff", *sets))


@pytest.mark.parametrize("down", [True, False])
def test_matrices_of_matlab_either_way_round(tmp_path, down):
    both = np.stack([G, 2 * G, 3 * G])
    scipy.io.savemat(tmp_path / "a.mat", {"w": 2 * np.pi * F, "H": both.T if down else both})
    frf = fq.read_response(tmp_path / "a.mat")
    np.testing.assert_allclose(frf.frequency, F)
    np.testing.assert_allclose(frf.response[:, 0], both)


def test_magnitude_and_phase_of_matlab(tmp_path):
    arrays = {"f": F, "magnitude": np.abs(G), "phase": np.degrees(np.angle(G))}
    scipy.io.savemat(tmp_path / "a.mat", arrays)
    np.testing.assert_allclose(fq.read_response(tmp_path / "a.mat").response[0, 0], G)


@pytest.mark.parametrize(
    "arrays",
    [{"H": G}, {"f": F, "H": G, "K": G}, {"f": F, "name": "x"}],
    ids=["no f", "two", "none"],
)
def test_files_of_matlab_without_one_response(tmp_path, arrays):
    scipy.io.savemat(tmp_path / "a.mat", arrays)
    with pytest.raises(ValueError, match=r"a\.mat.*expected frequencies f \(Hz\) or w"):
        fq.read_response(tmp_path / "a.mat")


@pytest.mark.parametrize(
    ("f", "words"),
    [(F + 0.1j, "'?f'? is complex; expected real numbers"), ("a" * 8, "holds .*; expected freq")],
    ids=["complex", "words"],
)
def test_frequencies_of_matlab_are_real_numbers(f, words, tmp_path):
    """The imaginary parts were lost, with a warning of numpy's."""
    scipy.io.savemat(tmp_path / "a.mat", {"f": f, "H": G} if isinstance(f, str) else {"f": f})
    with pytest.raises(ValueError, match=rf"a\.mat.*{words}"):
        fq.read_response(tmp_path / "a.mat")


def test_frequencies_of_matlab_that_are_no_numbers_warn_of_nothing(tmp_path):
    """One of them was a NaN that signals, which numpy warned of."""
    odd = F.view("u8").copy()
    odd[3] = 0x7FF0000000000001
    scipy.io.savemat(tmp_path / "a.mat", {"w": odd.view(float), "H": G})
    with pytest.raises(ValueError, match=r"a\.mat: frequency must be finite"):
        fq.read_response(tmp_path / "a.mat")
