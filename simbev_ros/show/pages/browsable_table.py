"""Builds tables that can be sorted and filtered in the browser: columns and cells enter, HTML leaves."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal

from simbev_ros.show.reports.svg_drawing import number

_CHOICE_OF_ALL = '<option value="">all</option>'


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        title: Its head; empty for a column of pictures, which cannot be sorted.
        filter: How rows are chosen by the values of the column: one of its words, a range, a part of the text, or not.
        label: What the column holds, as read aloud and shown under the pointer; by default the title.
        is_number: Whether its values are numbers.
    """

    title: str
    filter: Literal["choice", "range", "text"] | None = None
    label: str = ""
    is_number: bool = False


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a table.

    Attributes:
        value: What rows are sorted and filtered by; for a choice one or more words.
        html: What is shown; None: the value.
    """

    value: str | float
    html: str | None = None

    @property
    def shown(self) -> str:
        """HTML of what is shown."""
        if self.html is not None:
            return self.html
        return escape(self.value) if isinstance(self.value, str) else number(self.value)

    def render(self, label: str) -> str:
        """HTML of the cell with a label, which is shown where there are no heads above."""
        kind = ' class="text"' if isinstance(self.value, str) else ""
        return f'<td{kind} data-label="{escape(label)}" data-value="{escape(str(self.value))}">{self.shown}</td>'


def browsable_table(
    caption: str, columns: Sequence[Column], rows: Sequence[Sequence[Cell]], *, cards: bool = False
) -> str:
    """HTML of a table with controls that filter its rows above it; without scripts all rows are shown.

    Args:
        caption: What the rows are.
        columns: The columns.
        rows: The cells of each row, one for each column.
        cards: Whether rows are shown as cards side by side.
    """
    titles, kind = [column.title for column in columns], "browse cards" if cards else "browse"
    head = "".join(map(_head, columns))
    body = "".join(f"<tr>{''.join(map(Cell.render, row, titles))}</tr>" for row in rows)
    controls = "".join(
        _control(index, column, [row[index].value for row in rows]) for index, column in enumerate(columns)
    )
    return (
        f'<form class="filters" hidden aria-label="Filter the scenes">{controls}'
        f'<button type="reset">Reset</button><output id="shown" aria-live="polite">{len(rows)} scenes</output></form>'
        f'<div class="table" tabindex="0" role="region" aria-label="{escape(caption)}"><table class="{kind}">'
        f"<caption>{escape(caption)}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _head(column: Column) -> str:
    label = f' title="{escape(column.label)}"' if column.label else ""
    if not column.title:
        return f'<th scope="col"><span class="unseen">{escape(column.label)}</span></th>'
    kind = "number" if column.is_number else "text"
    button = f'<button type="button"{label}>{escape(column.title)}</button>'
    return f'<th scope="col" class="{kind}" data-kind="{kind}" aria-sort="none">{button}</th>'


def _control(index: int, column: Column, values: Sequence[str | float]) -> str:
    """HTML of the controls by which a column filters; empty if all rows have the same value."""
    if column.filter is None or len(set(values)) < 2:
        return ""
    name, title = f'name="c{index}', escape(column.title)
    if column.filter == "text":
        return f'<label>{title} <input type="search" {name}" data-test="text" data-column="{index}"></label>'
    if column.filter == "choice":
        words = sorted({word for value in values for word in str(value).split()})
        options = "".join(f'<option value="{escape(word)}">{escape(word.replace("_", " "))}</option>' for word in words)
        select = f'<select {name}" data-test="choice" data-column="{index}">{_CHOICE_OF_ALL}{options}</select>'
        return f"<label>{title} {select}</label>"
    ends = zip(("min", "max"), (min(map(float, values)), max(map(float, values))), strict=True)
    inputs = "".join(
        f'<input type="number" step="any" {name}{test}" data-test="{test}" data-column="{index}" '
        f'placeholder="{value:g}" aria-label="{title}, {test}imum">'
        for test, value in ends
    )
    return f'<span role="group" aria-label="{title}">{title} {inputs}</span>'
