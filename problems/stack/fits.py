"""Reads `[[fit]]`: the tolerance classes of two parts at once, "25 H7/g6"."""

from __future__ import annotations

from ...errors import Fault, nearest
from ...models.iso286 import pair_of_text
from ...section import Section


def read_fits(top: Section, faults: list[Fault]) -> dict[str, str]:
    """The tolerance class, like "25 H7", of each part that is in a `[[fit]]`.

    `parts` names the part with the hole first, `size` states the fit.
    """
    known = [name for table in top.tables("part") if isinstance(name := table.get("name"), str)]
    by_part: dict[str, str] = {}
    for at in range(len(top.tables("fit"))):
        section = top.item("fit", at, faults)
        names, text = section.names("parts"), section.text("size")
        for key, like in (("parts", '["bore", "pin"]'), ("size", '"25 H7/g6"')):
            if key not in section:
                section.fault(key, f"is missing: write {key} = {like}")
        section.finish()
        if names is not None:
            _check(section, names, known, by_part)
        if text is None:
            continue
        try:
            classes = pair_of_text(text)
        except ValueError as error:
            section.fault("size", str(error))
            continue
        for name, fit in zip(names or (), classes, strict=False):
            by_part[name] = f"{fit.size:g} {fit}" if fit.size is not None else str(fit)
    return by_part


def _check(section: Section, names: list[str], known: list[str], by_part: dict[str, str]) -> None:
    if len(names) != 2 or names[0] == names[1]:
        section.fault("parts", f"must name two different parts, the hole first, got {', '.join(names)}")
    for name in names:
        if name not in known:
            section.fault("parts", f'"{name}" is not a part{nearest(name, known)}')
        elif name in by_part:
            section.fault("parts", f"{name} is in another [[fit]] already")
