"""One row of a benchmark's table: what, the value measured, and what is wanted."""


def show(what, value, target=""):
    print(f"{what:66s} {value:>24s}   {target and f'({target})'}".rstrip(), flush=True)
