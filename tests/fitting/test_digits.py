"""Numbers in the digits that their errors leave."""

import math

import pytest
from hypothesis import given, strategies as st

import freqid as fq
from freqid.fitting.digits import in_digits, of_error, rounded

EST = fq.fit(
    fq.two_mass(),
    fq.simulate(fq.two_mass(), fq.chirp(10, 80, 2, 1e-3), 1e-3).with_noise(0.1, seed=0),
    band=(10, 80),
)


@given(st.floats(1e-12, 1e12), st.floats(1e-6, 1.0), st.booleans())
def test_what_is_left_out_is_less_than_a_twentieth_of_the_error(size, part, negative):
    value, std = -size if negative else size, part * size
    text = rounded(value, std)
    assert abs(float(text) - value) <= 0.051 * std
    digits = text.split("e")[0].replace("-", "").replace(".", "").lstrip("0")
    # zeros at the end of a whole number stand for its size
    if "." in text:
        assert len(digits) <= max(math.log10(size / std) + 4, 2)


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.00461, 0.0123, "1.005"), (0.02, 0.00064, "0.02000"), (149997.3, 2100.0, "150000"),
        (143.21, 0.0, "143.21"), (0.0, 0.1, "0"), (2.5, float("inf"), "2.5"),
        (1.5e-9, 2.2e-11, "1.500e-09"), (3.0, 40.0, "3"),
    ],
)  # fmt: skip
def test_as_a_paper_prints_it(value, std, text):
    assert rounded(value, std) == text


def test_errors_have_two_digits():
    assert [of_error(s) for s in (0.01234, 361.2, 1.0, 4.2e7)] == ["0.012", "360", "1.0", "4.2e+07"]


def test_every_view_of_an_estimate_shows_the_same_digits():
    table = in_digits(EST.parameters)
    for name, row in table.iterrows():
        assert f"  {name} = {row['value']} ± {row['±']}" in repr(EST)
        assert f"<td>{row['value']}</td>" in EST._repr_html_()
        assert row["lower"] != row["upper"]
    # numbers themselves stay what they are
    assert EST.parameters["value"]["k"] == EST["k"]


def test_modes_say_whether_the_band_holds_them():
    modes = EST.modes()
    assert modes["in_band"].tolist() == modes["frequency"].between(10, 80).tolist()
    assert modes["in_band"].any()
    assert not modes["in_band"].all()


def test_tables_show_the_digits_that_errors_leave_and_keep_all():
    import pickle

    table = EST.parameters
    assert "..." not in repr(table)
    for name, row in table.iterrows():
        assert rounded(row["value"], row["std"]) in repr(table)
        assert float(row["value"]) == EST[name]
    assert of_error(table["std"].iloc[0]) in table._repr_html_()
    modes = EST.modes()
    assert rounded(modes["frequency"].iloc[1], modes["frequency_std"].iloc[1]) in repr(modes)
    assert pickle.loads(pickle.dumps(table)).equals(table)
    assert type(table.loc[["k"]]).__name__ == "DataFrame"
