"""Pictures take anything that has a response, and name their units."""

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import freqid as fq


def test_bode_takes_everything(plant, slow):
    est = fq.fit(plant, slow, hold="foh", band=(10, 80))
    frf = fq.etfe(slow, band=(10, 80))
    axes = fq.bode(frf, est, plant, plant.to_control(), control.c2d(plant.to_control(), 5e-3),
                   labels=list("abcde"))  # fmt: skip
    assert len(axes[0].get_lines()) == 5
    assert axes[1].get_xlabel() == "frequency / (rad/s)"
    assert "degrees" in axes[1].get_ylabel()
    again = est.bode(ax=axes, unit="Hz", decibel=True)
    assert again is axes
    assert "Hz" in axes[1].get_xlabel()
    assert "dB" in axes[0].get_ylabel()


def test_amplitudes_have_the_units_of_their_channels(plant, slow, tmp_path):
    told = {"torque": "N m", "speed": "rad/s"}
    record = fq.Record(slow.u, slow.y, slow.dt, slow.hold, input_names=["torque"],
                       output_names=["speed"], units=told)  # fmt: skip
    for frf in (fq.etfe(record, band=(10, 80)), fq.h1(record, segment=500),
                fq.local_rational(record, band=(10, 80)).select((20, 40))):  # fmt: skip
        assert frf.units == told
        assert fq.bode(plant, frf)[0].get_ylabel() == "amplitude in (rad/s)/(N m)"
        assert frf.with_conditions(q=1.0).units == told
    assert fq.bode(frf, decibel=True)[0].get_ylabel() == "amplitude / dB re 1 (rad/s)/(N m)"
    assert fq.nyquist(frf).get_xlabel() == "real part in (rad/s)/(N m)"
    assert fq.bode(plant)[0].get_ylabel() == "amplitude"
    same = fq.FrequencyResponse([1.0], [1j], units={"u": "V", "y": "V"})
    assert fq.bode(same)[0].get_ylabel() == "amplitude"
    both = fq.FrequencyResponse([1.0, 2.0], np.ones((1, 2, 2)), output_names=["a"],
                                units={"u1": "N", "u2": "A", "a": "m"})  # fmt: skip
    grid = fq.bode(both)
    assert [grid[0, 0].get_ylabel(), grid[0, 1].get_ylabel()] == ["to a in m/N", "in m/A"]
    back = fq.FrequencyResponse.from_frame(both.to_frame())
    assert back.units == both.units
    (tmp_path / "frf.csv").write_text(both.to_frame().to_csv(index=False))
    assert fq.read_response(tmp_path / "frf.csv").units == both.units
    with pytest.raises(ValueError, match="units"):
        fq.FrequencyResponse([1.0], [1j], units={"torque": "N m"})


def test_phases_lie_next_to_each_other():
    omega = np.linspace(1, 10, 50)
    one = fq.FrequencyResponse(omega, np.exp(-1j * omega / 5))
    turned = fq.FrequencyResponse(omega, np.exp(-1j * (omega / 5 + 2 * np.pi + 0.05)))
    axes = fq.bode(one, turned)
    a, b = (line.get_ydata() for line in axes[1].get_lines())
    assert np.abs(a - b).max() < 5


def test_nyquist_record_and_coherence(plant, slow):
    ax = fq.nyquist(plant, omega=np.linspace(60, 500, 50), ticks=[20], unit="Hz", labels=["x"])
    assert ax.get_xlabel() == "real part"
    assert [t.get_text() for t in ax.texts] == ["20"]
    _, bottom = fq.plot_record(slow)
    assert "time / s" in bottom.get_xlabel()
    frf = fq.FrequencyResponse([1.0, 2], [1, 1j], coherence=[0.9, 1])
    assert fq.plot_coherence(frf).get_ylabel() == "coherence"
    with pytest.raises(ValueError, match="no coherence"):
        fq.plot_coherence(fq.FrequencyResponse([1.0], [1]))
    with pytest.raises(ValueError, match="unit='kHz'"):
        fq.bode(plant, unit="kHz")
    with pytest.raises(ValueError, match="labels has 2"):
        fq.bode(plant, labels=["a", "b"])
    with pytest.raises(ValueError, match="cannot be drawn"):
        fq.bode("plant")


def test_multiple_coherence_is_one_curve_of_each_output():
    of = np.array([[[0.9, 0.8], [0.9, 0.8]], [[0.7, 0.6], [0.7, 0.6]]])
    names = {"input_names": ["left", "right"], "output_names": ["x", "z"]}
    frf = fq.FrequencyResponse([1.0, 2], np.ones((2, 2, 2)), coherence=of, **names)
    ax = fq.plot_coherence(frf)
    assert [line.get_label() for line in ax.lines] == ["all inputs to x", "all inputs to z"]
    assert [line.get_ydata()[1] for line in ax.lines] == [0.8, 0.6]


def test_frequency_response_to_control_and_back(slow):
    frf = fq.etfe(slow, band=(10, 80))
    back = fq.FrequencyResponse.from_control(frf.to_control(), hold=frf.hold)
    assert np.allclose(back.frequency, frf.frequency)
    assert np.array_equal(back.response, frf.response)
    assert back.dt == frf.dt
    frame = frf.to_frame()
    assert len(frame) == 701
    assert np.allclose(
        frame["magnitude"] * np.exp(1j * np.deg2rad(frame["phase"])), frf.response[0, 0]
    )
    part = frf.select((20, 30))
    assert part.frequency.min() == pytest.approx(20)
    assert part.input_spectrum.shape == (1, 101)
    with pytest.raises(ValueError, match="holds no frequency"):
        frf.select((200, 300))
    with pytest.raises(ValueError, match="increasing"):
        fq.FrequencyResponse([2.0, 1], [1, 1])
    with pytest.raises(ValueError, match="response has shape"):
        fq.FrequencyResponse([1.0, 2], [1, 1, 1])


def test_etfe_of_a_periodic_record_is_the_held_plant():
    plant, dt, n = fq.first_order(), 1e-3, 1000
    u = np.tile(np.random.default_rng(0).standard_normal(n), 6)
    record = fq.simulate(plant, u, dt).slice(5 * n * dt)
    frf = fq.etfe(record, band=(5, 100))
    exact = plant.frequency_response(frf.omega, record.hold).response
    assert np.abs(frf.response / exact - 1).max() < 1e-9
    assert frf.hold == record.hold
    with pytest.raises(ValueError, match="has 2 inputs"):
        fq.etfe(fq.Record(np.ones((9, 2)), np.ones(9), 1))


def test_no_global_setting_is_changed(plant):
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    fq.bode(plant)
    assert dict(mpl.rcParams) == before


def test_noise_turns_no_phase_away_from_its_model():
    """Counted along the noise of an antiresonance a measured phase ended a turn off its model's."""
    plant, f = fq.two_mass(), np.linspace(5, 60, 200)
    G = plant.frequency_response(2 * np.pi * f).response
    for seed in range(5):
        e = np.random.default_rng(seed).standard_normal((2, *G.shape))
        size = 0.3 * np.abs(G).min() + 0.02 * np.abs(G).mean()
        noisy = fq.FrequencyResponse(
            f, G + size * (e[0] + 1j * e[1]), variance=np.full(G.shape, 2 * size**2)
        )
        for order in ((noisy, plant), (plant, noisy)):
            axes = fq.bode(*order, unit="Hz")
            measured, model = (
                next(x for x in axes[1].lines if len(x.get_xdata()) == len(f)),
                next(x for x in axes[1].lines if len(x.get_xdata()) != len(f)),
            )
            along = np.interp(f, model.get_xdata(), model.get_ydata())
            assert np.abs(measured.get_ydata() - along).max() < 181
            plt.close("all")


def test_a_comparison_zooms_into_its_worst_stretch(plant, slow):
    wrong = slow.outputs.copy()
    wrong[700:720] += 5.0
    record = fq.Record(slow.u, wrong[:, 0], slow.dt, hold=slow.hold, output_names=["speed"])
    comparison = fq.compare(plant, record)
    axes = comparison.plot(zoom=True)
    assert len(axes) == 4
    near = axes[2].get_lines()[0].get_xdata()
    assert near[0] <= record.time[700]
    assert near[-1] >= record.time[719]
    assert 40 <= len(near) <= 80
    f, amplitude = axes[3].get_lines()[1].get_data()
    assert f[-1] == pytest.approx(record.nyquist)
    # Parseval: half of the squares of the amplitudes is the variance, but for the last line
    left = comparison.residuals.ravel()[: len(record.y)]
    assert (amplitude**2).sum() / 2 == pytest.approx(np.var(left), rel=0.01)
    assert len(comparison.plot()) == 2
    with pytest.raises(ValueError, match="a response has none"):
        fq.compare(plant, fq.etfe(slow, band=(10, 80))).plot(zoom=True)
    with pytest.raises(ValueError, match="ax holds 2 axes; expected 4"):
        comparison.plot(ax=plt.subplots(2, 1)[1], zoom=True)
    plt.close("all")


def test_a_single_line_is_a_dot_in_the_complex_plane():
    """There was nothing to be seen."""
    ax = fq.nyquist(fq.FrequencyResponse([2.0], [1 - 1j]))
    assert [line.get_marker() for line in ax.lines] == ["o"]


def test_nyquist_curves_of_several_channels_can_be_told_apart():
    plant = fq.drivetrain(2, outputs=("motor velocity", "arm velocity"))
    ax = fq.nyquist(plant, plant.with_values(d1=20.0), labels=["before", "after"])
    told = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(told) == len(set(told)) == len(ax.lines) == 4
    assert told[0].startswith("before, torque to ")
    colours, dashes = ([getattr(c, f"get_{of}")() for c in ax.lines] for of in ("color", "ls"))
    assert colours[:2] == colours[2:]
    assert colours[0] != colours[1]
    assert dashes[0] == dashes[1] != dashes[2]


def test_odd_responses_are_drawn_or_refused_in_words(plant, slow):
    at_zero = fq.FrequencyResponse([0.0], [1j])
    fq.bode(at_zero)
    one = fq.bode(fq.FrequencyResponse([5.0], [1j]))
    assert one[0].lines[0].get_marker() == "o"
    with pytest.raises(ValueError, match="styles has 0"):
        fq.bode(plant, styles=[])
    fq.bode(plant, plant, styles=[None, {"color": "red"}])
    low = fq.fit(plant, slow, band=(10, 40))
    high = fq.fit(plant, slow, band=(50, 80))
    axes = fq.bode(low, unit="Hz")
    before = axes[0].get_xlim()
    fq.bode(high, unit="Hz", ax=axes)
    assert axes[0].get_xlim()[0] <= before[0]
    plt.close("all")


def test_tables_of_an_estimate_are_the_readers_own(plant, slow):
    est = fq.fit(plant, slow.with_noise(0.1), band=(10, 80))
    table = est.parameters
    table["std"] = 0.0
    assert (est.parameters["std"] > 0).all()


def test_a_hold_that_outlasts_samples_is_refused_in_words(plant, slow):
    with pytest.raises(ValueError, match="outlasts"):
        fq.fit(plant, slow.with_hold(fq.ZeroOrderHold(2 * slow.dt)), band=(10, 80))


def test_a_record_too_short_for_a_spectrogram_is_told():
    short = fq.Record(np.arange(8.0) % 3, np.arange(8.0) % 2, 0.1)
    with pytest.raises(ValueError, match="segment=16 is longer than the 8 samples"):
        fq.plot_spectrogram(short)
