"""The least that differs from the usual and still goes wrong: part by part, then gene by gene, is put back.

It goes on until nothing more can be put back: what one value needed may go when another one has gone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sitl.campaign.campaign_file import SearchPart
from sitl.search.goals import Goal
from sitl.search.search import Driven, Find, finds_in

Told = Callable[[Find], None]
"""Called with what is left after each value, or part, that could be put back."""


def minimised(find: Find, goal: Goal, drive: Driven, told: Told = lambda find: None) -> tuple[Find, list[Find]]:
    """The same find with as few values as it needs, and what other rules were broken by the tries on the way.

    ``goal``: of the search. ``drive`` is asked for each try, for some of them again and again.
    """
    besides: list[Find] = []
    while True:
        before = len(find.values)
        parts = [[gene.name for gene in find.genes if gene.part == part] for part in SearchPart]
        for names in [*parts, *([name] for name in find.values)]:
            fewer = {name: value for name, value in find.values.items() if name not in names}
            if len(fewer) == len(find.values):
                continue
            tried = replace(find, values=fewer)
            if tried.spec == find.spec:  # like the time of a fault that does not happen
                find = tried
                continue
            (result,) = drive([tried.spec])
            shown = finds_in(goal, find.base, find.genes, fewer, result)
            besides += [one for one in shown if one.rule != find.rule]
            if find.again(result):
                find = replace(tried, result=result)
                told(find)
        if len(find.values) == before:
            return find, besides
