"""Shared plants, records and switches of the suite."""

import contextlib
import os
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest

matplotlib.use("agg")

import scipy.linalg
from threadpoolctl import threadpool_limits

import freqid as fq

# as many processes as cores, each with one thread: idle workers of BLAS would take their turns.
# Commands and examples that tests start inherit it.
if "PYTEST_XDIST_WORKER" in os.environ:
    assert scipy.linalg
    threadpool_limits(1, "blas")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

T1, T2 = 0.5e-3, 5e-3
BAND = (10, 80)
LONG = ("test_examples.py", "test_docs_pages.py", "test_readme.py", "test_explorer.py")


def pytest_addoption(parser):
    parser.addoption(
        "--studies", action="store_true",
        help="all cases of the tests marked study, of which else the first of several is run",
    )  # fmt: skip


def pytest_collection_modifyitems(config, items):
    """Of a study the first of several cases runs, unless all were asked for, or it by its name.

    Examples and pages, each a minute or less, come first: at the end one process would wait.
    """
    items.sort(key=lambda item: item.path.name not in LONG)
    if config.getoption("--studies") or any("::" in arg for arg in config.args):
        return
    seen, kept, left = set(), [], []
    for item in items:
        study = item.get_closest_marker("study") is not None
        name = item.nodeid.partition("[")[0]
        # one that has a single case repeats within it, and has no shorter version
        skipped = study and (name in seen or not hasattr(item, "callspec"))
        seen.add(name)
        (left if skipped else kept).append(item)
    config.hook.pytest_deselected(items=left)
    items[:] = kept


@pytest.fixture(scope="module")
def benchmarks():
    """The folder of the long studies, from which a module may import for as long as it runs."""
    folder = str(Path(__file__).resolve().parents[1] / "benchmarks")
    sys.path.insert(0, folder)
    yield folder
    sys.path.remove(folder)


@pytest.fixture
def two_workers():
    """Begins a block in which joblib's jobs go to a Dask cluster of two processes; its client."""
    distributed = pytest.importorskip("dask.distributed")
    joblib = pytest.importorskip("joblib")

    @contextlib.contextmanager
    def begin():
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
            ) as cluster,
            distributed.Client(cluster) as client,
            joblib.parallel_config(backend="dask"),
        ):
            yield client

    return begin


@pytest.fixture(scope="session")
def plant():
    return fq.two_mass()


@pytest.fixture(scope="session")
def fast(plant):
    """The paper's experiment: cosine chirp, 10 s at 2 kHz, noise-free."""
    return fq.simulate(plant, fq.chirp(10, 80, duration=10, dt=T1), dt=T1)


@pytest.fixture(scope="session")
def slow(fast):
    return fast.decimate(10)


@pytest.fixture(scope="session")
def measured():
    """The folder of measured data: ../shared/data beside the checkout, or FREQID_DATA."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("FREQID_DATA", beside))
    if not (folder / "ruler_robot").is_dir():
        pytest.skip(f"no measured data: {folder / 'ruler_robot'} is missing; set FREQID_DATA")
    return folder


@pytest.fixture(autouse=True)
def _close_figures():
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.fixture
def relative_error():
    def of(estimate, plant):
        return max(abs(estimate[n] / plant[n] - 1) for n in estimate.names)

    return of


@pytest.fixture
def rng():
    return np.random.default_rng(20051)
