"""Mutants for the length of a test: a function with one text in it replaced, wherever a module holds it."""

import inspect
import sys
import textwrap


def put_in_place(monkeypatch, function, old, new):
    """Replace a text that occurs once in a function's source."""
    source = textwrap.dedent(inspect.getsource(function))
    if source.count(old) != 1:
        raise ValueError(f"{function.__qualname__}: {old!r} occurs {source.count(old)} times, expected once")
    made = {}
    exec(compile(source.replace(old, new), inspect.getfile(function), "exec"), function.__globals__, made)
    broken = made[function.__name__]
    holders = [m for n, m in sys.modules.items() if n.startswith(("ephs", "tests")) and m is not None]
    holders += [
        each for m in holders for each in vars(m).values() if inspect.isclass(each) and each.__module__ == m.__name__
    ]
    for holder in holders:
        for name, value in list(vars(holder).items()):
            if value is function:
                monkeypatch.setattr(holder, name, broken)
