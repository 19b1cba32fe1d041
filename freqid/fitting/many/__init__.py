"""Many fits: one row a record, safe on disk, by processes or on a cluster."""

from freqid.fitting.many.fleet import fit_many
from freqid.fitting.many.store import TableStore, made_by_a_store
