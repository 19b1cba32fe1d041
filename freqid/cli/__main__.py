"""``python -m freqid.cli``: the command line where the script itself is not on the path."""

from freqid.cli.commands import main

main()
