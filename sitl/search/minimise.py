"""The least that differs from the usual and still goes wrong: part by part, then gene by gene, is put back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sitl.campaign.campaign_file import SearchPart
from sitl.search.search import Driven, Find


def minimised(find: Find, drive: Driven) -> Find:
    """The same find with as few values as it needs; it is driven again for each try."""
    parts = [[gene.name for gene in find.genes if gene.part == part] for part in SearchPart]
    for names in [*parts, *([gene.name] for gene in find.genes)]:
        find = _without(find, names, drive)
    return find


def _without(find: Find, names: Sequence[str], drive: Driven) -> Find:
    fewer = {name: value for name, value in find.values.items() if name not in names}
    if len(fewer) == len(find.values):
        return find
    tried = replace(find, values=fewer)
    (result,) = drive([tried.spec])
    return replace(tried, result=result) if find.again(result) else find
