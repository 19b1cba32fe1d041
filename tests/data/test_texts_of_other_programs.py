"""Text tables with names in two lines, words for infinite numbers, and one bad cell."""

import numpy as np
import pytest

import freqid as fq

ROWS = [[f"{0.01 * i:.2f}", f"{i % 7}", f"{i % 5}"] for i in range(200)]


def written(tmp_path, rows, head="time,u,y"):
    path = tmp_path / "log.csv"
    path.write_text("\n".join([head, *(",".join(r) for r in rows)]) + "\n")
    return path


def with_cell(row, column, text):
    rows = [list(r) for r in ROWS]
    rows[row][column] = text
    return rows


@pytest.mark.parametrize(
    "text", ["1.#INF", "-1.#INF", "1.#INF000e+000", "-1.#IND", "1.#QNAN", "1.#SNAN00"]
)
@pytest.mark.parametrize("column", [1, 2])
def test_old_words_for_no_number_are_none(tmp_path, text, column):
    with pytest.raises(ValueError, match=r"(NaN|infinite).*row 40"):
        fq.read(written(tmp_path, with_cell(40, column, text)))


def test_names_of_two_lines_are_names(tmp_path):
    path = written(tmp_path, [[str(10 * i), r[1], r[2]] for i, r in enumerate(ROWS)],
                   '"Time\n(ms)","Torque\n[N m]","Speed"')  # fmt: skip
    record = fq.read(path, inputs="Torque", outputs="Speed")
    assert record.dt == pytest.approx(0.01)
    assert record.units == {"Torque": "N m"}
    assert record.n_samples == 200


def test_quoted_rows_are_not_joined(tmp_path):
    path = tmp_path / "quoted.csv"
    rows = [["time", "u", "y"], *ROWS]
    path.write_text("\n".join(",".join(f'"{c}"' for c in r) for r in rows) + "\n")
    np.testing.assert_array_equal(fq.read(path).u, [float(r[1]) for r in ROWS])


def test_a_stray_quotation_mark_joins_nothing(tmp_path):
    record = fq.read(written(tmp_path, ROWS, 'time,u 5",y'))
    assert record.n_samples == 200


@pytest.mark.parametrize("text", ["0.1x45", "OVL"])
@pytest.mark.parametrize("column", [0, 2])
def test_a_cell_that_is_no_number_is_named_with_its_row(tmp_path, text, column):
    words = [f"'time' holds '{text}' in row 150", "", f"'{text}' in row 150 of 'y'"][column]
    with pytest.raises(ValueError, match=words):
        fq.read(written(tmp_path, with_cell(150, column, text)))


def test_a_last_line_of_words_is_named(tmp_path):
    with pytest.raises(ValueError, match="holds 'End of file' in row 200"):
        fq.read(written(tmp_path, [*ROWS, ["End of file"]]))


def test_a_unit_behind_in_is_one(tmp_path):
    rows = [[str(10 * i), r[1], r[2]] for i, r in enumerate(ROWS)]
    record = fq.read(written(tmp_path, rows, "Time in ms,torque in N m,speed"))
    assert record.dt == pytest.approx(0.01)
    assert record.units == {"torque": "N m"}


def test_the_unit_of_a_universal_files_time(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    t = 10.0 * np.arange(60)
    sets = [pyuff.prepare_58(
        func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, data=np.sin(t + k), x=t,
        id1=name, abscissa_spacing=1, abscissa_inc=10.0, abscissa_min=0.0, binary=0,
        ord_data_type=4, num_pts=60, ordinate_axis_units_lab="m", abscissa_axis_units_lab="ms",
        ver_num=0, load_case_id=0, rsp_ent_name="NONE", ref_ent_name="NONE", id2="NONE",
        id3="NONE", id4="NONE", id5="NONE", z_axis_value=0.0, orddenom_spec_data_type=0,
        ordinate_spec_data_type=8,
    ) for k, name in enumerate("uy")]  # fmt: skip
    pyuff.UFF(str(tmp_path / "a.uff")).write_sets(sets, "overwrite")
    record = fq.read(tmp_path / "a.uff", inputs="u", outputs="y")
    assert record.dt == pytest.approx(0.01)
    assert record.units == {"u": "m", "y": "m"}


def test_samples_that_a_measurement_file_marks_as_invalid_are_none(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    k = np.arange(50)
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(np.sin(k), 0.01 * k, name="u"),
            asammdf.Signal(np.cos(k), 0.01 * k, name="y", invalidation_bits=k == 3),
        ]
        file.append(signals)
        file.save(tmp_path / "a.mf4", overwrite=True)
    record = fq.read(tmp_path / "a.mf4", inputs="u", outputs="y")
    # the first output may come a rounding before the first input
    assert len(record.y_logged) in (48, 49)
    assert not np.isclose(record.y_logged, np.cos(3)).any()
    assert any("1 samples of 'y' are marked as invalid" in note for note in record.notes)


@pytest.mark.parametrize("separator", [",", " ", ";"])
def test_double_precision_of_fortran_is_read(tmp_path, separator):
    values = np.random.default_rng(0).normal(size=(200, 2))
    values[3] = 0.0
    path = tmp_path / "run.dat"
    rows = [
        separator.join([f"{0.01 * i:.4f}", *(f"{v:.8E}".replace("E", "D") for v in pair)])
        for i, pair in enumerate(values)
    ]
    path.write_text("\n".join([separator.join(["time", "u", "D1"]), *rows]) + "\n")
    record = fq.read(path, inputs="u", outputs="D1")
    np.testing.assert_allclose(record.u, values[:, 0], rtol=1e-8)
    np.testing.assert_allclose(record.y, values[:, 1], rtol=1e-8)
