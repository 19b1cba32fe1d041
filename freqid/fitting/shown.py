"""What every estimate can show of itself: pictures, a page, a file, words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freqid.checks import InputError
from freqid.fitting import printed
from freqid.fitting.separate import separate_values
from freqid.lti import Hold

if TYPE_CHECKING:
    import control
    import pandas as pd
    from matplotlib.axes import Axes

    from freqid.data import DataSet


class Shown:
    """The part of an Estimate that shows it, or hands it to others."""

    model: Any
    hold: Hold
    data: Sequence[DataSet]

    @property
    def parameters(self) -> pd.DataFrame:
        """Values, standard errors and intervals of the free parameters."""
        raise NotImplementedError

    @property
    def separate(self) -> pd.DataFrame:
        """Parameters that each experiment has for itself, with their standard errors.

        A row for each experiment, columns ``fm``, ``fm_std``, …; NaN where one is known.
        """
        return separate_values(self.parameters, len(self.data))

    def to_control(self, pade: int | None = None) -> control.StateSpace:
        """The estimated model as a ``control.StateSpace``."""
        return self.model.to_control(pade)

    def to_continuous(self, hold: Hold | str | None = None) -> control.StateSpace:
        """A black-box model in continuous time, by inverting its hold (see ``OutputError``)."""
        if not hasattr(self.model, "to_continuous"):
            raise InputError("the model is in continuous time already; use to_control()")
        return self.model.to_continuous(self.hold if hold is None else hold)

    def bode(self, ax: Any = None, **options: Any) -> Any:
        """Draw amplitude and phase of the estimate; see ``freqid.bode``."""
        from freqid.plots import bode

        return bode(self, ax=ax, **options)

    def nyquist(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the Nyquist curve of the estimate; see ``freqid.nyquist``."""
        from freqid.plots import nyquist

        return nyquist(self, ax=ax, **options)

    def report(
        self,
        path: str | Path,
        title: str | None = None,
        *,
        validation: DataSet | None = None,
        overwrite: bool = False,
    ) -> None:
        """Write one self-contained HTML page about the estimate, which works offline.

        A sentence on whether it may be trusted, the parameters with error and bias bars, response
        and simulation to zoom into, residual tests, warnings, and the call that made it. Another
        record or response as ``validation`` is compared, too, and has a say in the verdict. Raises
        ValueError for another suffix than .html, without the extra ``report``, or for a file that
        is there and is no such page, without ``overwrite``.
        """
        from freqid.pages import write_report

        write_report(self, path, title, validation, overwrite)  # type: ignore[arg-type]

    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the estimate to a .json file that ``freqid.load`` reads, in any later process.

        Values, covariance, hold, band, witness, verdict and warnings, the model, and what the data
        were; not the data. Raises ValueError for another suffix, or a file that is there already
        without ``overwrite``.
        """
        from freqid.fitting.kept import save

        save(self, path, overwrite)  # type: ignore[arg-type]

    def to_dict(self) -> dict[str, object]:
        """Everything that a file needs, in plain numbers and strings."""
        return printed.as_dict(self)  # type: ignore[arg-type]

    def __repr__(self) -> str:
        return printed.as_text(self)  # type: ignore[arg-type]

    def _repr_html_(self) -> str:
        return printed.as_html(self)  # type: ignore[arg-type]
