"""Pages for a browser: a report on one estimate, and an explorer with sliders.

They may import all packages but ``paper`` and ``cli``.
"""

from freqid.pages.explorer.page import explore
from freqid.pages.explorer.state import Own
from freqid.pages.report.page import write_report
from freqid.pages.report.sentences import validated
