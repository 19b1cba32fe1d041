"""Data: records, frequency responses and their files, bands, and whether samples can be trusted.

It may import what stands below it: checks and lti.
"""

from freqid.data.averaged_response import AveragedResponse
from freqid.data.band import Band, as_band, chosen
from freqid.data.channel_order import displaced, with_channels
from freqid.data.conditions import as_conditions
from freqid.data.data_set import (
    DataSet,
    as_data_sets,
    channel_counts,
    common_names,
    input_dt,
    output_dt,
    rate_factor,
)
from freqid.data.empirical_response import EmpiricalResponse
from freqid.data.files import check_name, naming, read, whole_file, write
from freqid.data.folding import fold, held_for, low_pass_gain, merged_lines, power_above, unfold
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.local_response import LineNoise, LocalResponse, ToldNoise, noise_that_is_told
from freqid.data.logged import channels
from freqid.data.misread import misread
from freqid.data.periodic_response import PeriodicResponse
from freqid.data.progress import Bar
from freqid.data.quality import check_record
from freqid.data.readers.headings import named_with
from freqid.data.readers.kinds import ResponseFile
from freqid.data.readers.npz import check_arrays
from freqid.data.record import Record
from freqid.data.record_sets import Reference, as_records, on_a_grid, references_of
from freqid.data.replacing import check_replacing
from freqid.data.response_files import picked, read_response
from freqid.data.running import alone, configured, every_core, in_turn, unordered
from freqid.data.selection import as_holds, check_hold, flat
from freqid.data.sources import in_python, source, that_estimates
from freqid.data.stamped_record import StampedRecord
from freqid.data.stream_chain import files_of
from freqid.data.stream_sources import open
from freqid.data.streams import Stream
from freqid.data.told_hold import folded_part
from freqid.data.units import (
    is_count,
    is_of_time,
    is_share,
    meant,
    multiple,
    units_of_channels,
)
