"""What is asked of every estimate: whether it may be trusted, and what speaks against it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from freqid.fitting.findings import (
    MUCH_FOLDED,
    Finding,
    Inquired,
    between_parts,
    suspects_table,
)
from freqid.fitting.grades import Verdict, verdict
from freqid.fitting.search.verdict import Witness
from freqid.fitting.twins import exchangeable

if TYPE_CHECKING:
    import pandas as pd

    from freqid.fitting.uncertainty.minimum import Minimum


class Questioned:
    """The part of an Estimate that answers for it. Each question is asked once, when it is read."""

    signs: Sequence[Finding]
    testimony: Callable[[], Witness] | None
    inquiry: Inquired | None
    problem: Minimum | None

    @cached_property
    def witness(self) -> Witness:
        """What a black box of the plant's order says: is a better minimum left, does a part lack.

        Its ``verdict`` is "complete", "lacking" or "absent", with ``cost``, ``f``, ``p_value`` and
        a ``sentence``.
        """
        if self.testimony is None:
            return Witness("absent", "a black box of its own order is no witness")
        return self.testimony()

    @cached_property
    def warnings(self) -> list[Finding]:
        """Why the result should not be trusted: sentences (``str``) with ``kind``, ``severity`` and
        ``number``. The suspects are asked when this is read for the first time.
        """
        asked = [] if self.inquiry is None else self.inquiry.findings()
        if self.inquiry is not None:
            changed = "unsteady" in [a.kind for a in asked]
            asked = [*asked, *self.inquiry.on_modes(self, changed)]  # type: ignore[arg-type]
        # what decimation has folded looks like a loop, another hold, or a plant that bends
        folded = [s for s in self.signs if _much_folded(s)]
        others = [s for s in self.signs if not _much_folded(s)]
        found = [*folded, *asked, *others, *exchangeable(self.problem)]
        if self.inquiry is None or any(f.severity == "serious" for f in found):
            return found
        return [*found, *self.inquiry.on_memory(self)]  # type: ignore[arg-type]

    @cached_property
    def verdict(self) -> Verdict:
        """Whether to use the numbers: ``grade`` "trust", "doubt" or "do not use", and ``reasons``.

        >>> import freqid as fq
        >>> record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3).with_noise(0.01)
        >>> fq.fit(fq.first_order(), record).verdict.grade
        'trust'
        """
        return verdict(self)  # type: ignore[arg-type]

    @cached_property
    def suspects(self) -> pd.DataFrame:
        """What the data may hold that the model lacks, by score tests, the strongest first.

        Index: suspect; columns ``statistic`` (F), ``p_value``, ``size`` in its ``unit``, ``power``,
        the part of it that the parameters leave to be seen, and ``largest_shift``, what it would do
        to a parameter in standard errors. Empty where nothing is left to be tested.

        Source: Söderström and Stoica, System Identification, 1989, appendix B.
        """
        return suspects_table() if self.inquiry is None else self.inquiry.table()

    @cached_property
    def spread(self) -> pd.DataFrame:
        """How far the numbers move between parts of the data, each fitted apart.

        Index: what lies ``between`` (experiments, record halves, band halves), and parameter, or
        mode of a black box. Columns: how many ``parts``, ``value``, the largest ``shift`` in
        standard errors and in ``percent``, ``p_value`` of all together, ``std``, and ``widened``,
        the standard error by the parts' own scatter where that is more than noise (p < 0.001).
        Empty for an estimate that was read from a file, which does not hold the data.
        Source: Birge, Physical Review 40, 1932.
        """
        if self.inquiry is None:
            return between_parts()
        return self.inquiry.spread(self)  # type: ignore[arg-type]


def _much_folded(sign: str) -> bool:
    # a sign of somebody's own may be a plain sentence, without kind or number
    kind, part = getattr(sign, "kind", ""), getattr(sign, "number", None)
    return kind == "aliased" and part is not None and part > MUCH_FOLDED
