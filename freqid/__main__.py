"""``python -m freqid``: the command line."""

from freqid.cli.commands import main

if __name__ == "__main__":
    main()
