from freqid.validation.comparison import Comparison
