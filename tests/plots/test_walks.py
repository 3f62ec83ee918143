import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from scipy import stats

from nichechain.core.errors import NichechainError
from nichechain.plots.walks import DRAWN, draw_study, line_styles, plot_runs, plot_walks

LABELS = ("selective", "0.5", "random")


@pytest.fixture(scope="module")
def records():
    rng = np.random.default_rng(0)
    condition, run, step = (a.ravel() for a in np.meshgrid(LABELS, range(6), range(12), indexing="ij"))
    columns = {measure: rng.uniform(0.2, 1, step.size) for measure in DRAWN}
    return pd.DataFrame({"condition": condition, "run": run, "step": step, **columns})


@pytest.fixture
def ax():
    return Figure().add_subplot()


def values(records, label, measure="expected_evolvability"):
    return (
        records[records["condition"] == label].pivot_table(index="run", columns="step", values=measure)
    ).to_numpy()


def lightness(color):
    return float(np.dot(to_rgb(color), (0.2126, 0.7152, 0.0722)))


@pytest.mark.parametrize("measure", DRAWN)
def test_lines_are_means_and_bands_are_t_intervals(records, ax, measure):
    assert plot_walks(records, ax, measure=measure, unit="m") is ax
    assert [line.get_label() for line in ax.lines] == [f"{label} (6 runs)" for label in LABELS]
    for label, line, band in zip(LABELS, ax.lines, ax.collections, strict=True):
        of = values(records, label, measure)
        np.testing.assert_allclose(line.get_ydata(), of.mean(axis=0))
        bounds = stats.t.interval(0.95, 5, of.mean(axis=0), stats.sem(of, axis=0))
        drawn = band.get_paths()[0].vertices
        for step in range(12):
            at = drawn[drawn[:, 0] == step, 1]
            assert (at.min(), at.max()) == pytest.approx((bounds[0][step], bounds[1][step]))
    assert ax.get_xlabel() == "step"
    assert ax.get_ylabel().endswith("(m)") == (measure != "coverage")


def test_conditions_are_drawn_in_the_order_asked(records, ax):
    plot_walks(records, ax, conditions=("random", "selective"))
    assert [line.get_label().split()[0] for line in ax.lines] == ["random", "selective"]


def test_a_single_run_is_a_line_without_a_band(records, ax):
    plot_walks(records[records["run"] == 0], ax, conditions=("0.5",))
    assert ax.lines[0].get_label() == "0.5 (1 run)"
    vertices = [path.vertices for path in ax.collections[0].get_paths()]
    assert not any(np.isfinite(vertex).all(axis=1).any() for vertex in vertices)
    ax.get_figure().canvas.draw()


def test_a_run_without_a_value_is_left_out_of_the_mean(records, ax):
    missing = (records["condition"] == "random") & (records["run"] == 2) & (records["step"] == 4)
    gap = records.assign(
        expected_evolvability=records["expected_evolvability"].mask(missing),
    )
    plot_walks(gap, ax, conditions=("random",))
    expected = np.delete(values(records, "random")[:, 4], 2).mean()
    assert ax.lines[0].get_ydata()[4] == pytest.approx(expected)


def test_every_run_is_a_mark_and_the_box_has_the_quartiles(records, ax):
    plot_runs(records, ax, step=7, ordered=True)
    marks = [line for line in ax.lines if line.get_linestyle() == "None"]
    for place, (label, mark) in enumerate(zip(LABELS, marks, strict=True)):
        of = values(records, label)[:, 7]
        np.testing.assert_allclose(mark.get_ydata(), of)
        assert len(set(mark.get_xdata())) == 6
        assert np.abs(mark.get_xdata() - place).max() < 0.3
        box = ax.patches[place].get_path().vertices[:, 1]
        assert (box.min(), box.max()) == pytest.approx(tuple(np.quantile(of, (0.25, 0.75))))
    assert [tick.get_text() for tick in ax.get_xticklabels()] == list(LABELS)


def test_a_study_has_four_panels_and_one_legend(records):
    figure = draw_study(records, step=11, ordered=True, unit="m", title="Pressure")
    assert [ax.get_ylabel() for ax in figure.axes] == [
        "expected evolvability η* (m)",
        "expected evolvability η* (m)",
        "evolvability η (m)",
        "coverage d/n of the offspring",
    ]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [f"{label} (6 runs)" for label in LABELS]
    figure.canvas.draw()


@pytest.mark.parametrize("number", [2, 3, 6, 7, 10])
def test_levels_grow_lighter(number):
    styles = list(line_styles([str(k) for k in range(number)], ordered=True).values())
    light = [lightness(style.color) for style in styles]
    assert light == sorted(light)
    assert np.diff(light).min() > 0.01
    # Still to be seen on white.
    assert light[-1] < 0.85


@pytest.mark.parametrize("number", [5, 7, 9])
def test_conditions_differ_without_colour(number):
    styles = line_styles([str(k) for k in range(number)])
    assert len({style.color for style in styles.values()}) == number
    assert len({(style.marker, str(style.dashes)) for style in styles.values()}) == number


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda r, ax: plot_walks(r, ax, measure="speed"), "measure is 'speed'"),
        (lambda r, ax: plot_walks(r, ax, conditions=("kde",)), "condition is 'kde'"),
        (lambda r, ax: plot_walks(r.iloc[:0], ax), "no finished walks"),
        (lambda r, ax: plot_runs(r, ax, step=12), "step is 12, but the walks have steps 0 to 11"),
    ],
)
def test_what_cannot_be_drawn_is_said(records, ax, call, said):
    with pytest.raises(NichechainError, match=said):
        call(records, ax)
